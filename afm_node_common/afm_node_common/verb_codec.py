"""Verbs and what they bring back as actions of afm_msgs, both ways: by the fields that both declare, of the same names.

A verb of this package has a separate action. Any other is asked for by the action `verb`, with its fields as
parameters and a result of named arrays.
"""

import array
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from afm_msgs import action, msg
from afm_msgs.msg import NamedArray
from diagnostic_msgs.msg import KeyValue
from rcl_interfaces.msg import Parameter as ParameterMessage
from rclpy.parameter import Parameter

from afm_model.core import registry
from afm_model.core.schema import python_value
from afm_model.microscope.arrays import Arrays, Variable, arrays_of
from afm_model.microscope.image import Image
from afm_model.microscope.results import CANCELLED, COMPLETE, FAILED, Outcome, Standing, TimeSeries
from afm_model.microscope.verb import Verb, find

from .decoding import channels_of, values_of, variable_of

ANY = "verb"
"""Name of the action for every verb without a separate action."""
_TOLD = ("success", "message")
TITLES = {name: "".join(part.capitalize() for part in name.split("_")) for name in (*registry.names("verb"), ANY)}
"""Names of the types, and of the verbs for people, by the names of the actions."""
ACTIONS: dict[str, Any] = {name: getattr(action, kind) for name, kind in TITLES.items() if hasattr(action, kind)}
"""Types of actions by their names, which are those of the verbs."""


def action_of(verb: Verb) -> str:
    """Name of the action by which a verb is asked for."""
    return verb.name if verb.name in ACTIONS and find(verb.name) is type(verb) else ANY


def goal_of(verb: Verb) -> Any:
    """A verb as a goal of its action."""
    name = action_of(verb)
    values = {field: getattr(verb, field) for field in type(verb).model_fields}
    if name != ANY:
        kinds = ACTIONS[name].Goal.get_fields_and_field_types()
        for field, value in values.items():
            if isinstance(value, tuple):
                values[field] = list(value)
            elif kinds[field] == "sequence<string>":  # several words, which are one text in the verb
                values[field] = [word for each in value.split(",") if (word := each.strip())]
        return ACTIONS[name].Goal(**values)
    kind = type(verb)
    known = verb.name in registry.names("verb") and find(verb.name) is kind
    title = verb.name if known else f"{kind.__module__}:{kind.__qualname__}"
    return ACTIONS[ANY].Goal(verb=title, fields=parameters(values))


def verb_of(name: str, goal: Any) -> Verb:
    """The verb that a goal of the action `name` asks for.

    Raises
    ------
    ParameterError
        If there is no such verb, or a value is not allowed: one sentence.
    """
    if name == ANY:
        return find(goal.verb).of(values_of(goal.fields))
    verb = find(name)
    given = {field: getattr(goal, field) for field in verb.model_fields}
    # A list is one of words: numbers come as arrays.
    return verb.of({field: ", ".join(value) if isinstance(value, list) else value for field, value in given.items()})


def put_outcome(outcome: Outcome, result: Any) -> Any:
    """Write how a verb has ended into the result of its action, with all that was measured; the lines of a scan are
    sent on a separate topic.
    """
    result.success, result.message = outcome.status == COMPLETE, outcome.message
    found = outcome.result
    if isinstance(result, action.Verb.Result):
        standing = vars(found) if isinstance(found, Standing) else {}
        plain = Arrays({name: Variable((), np.asarray(value), {}) for name, value in standing.items()})
        _put_arrays(arrays_of(found) or plain, result)
    elif isinstance(found, Sequence):
        (name,) = set(result.get_fields_and_field_types()) - set(_TOLD)
        setattr(result, name, [_encoded(each) for each in found])
    elif found is not None:
        _put(found, result)
    return result


def outcome_of(verb: Verb, result: Any, *, cancelled: bool, image: Image | None = None) -> Outcome:
    """The inverse of `put_outcome`.

    Parameters
    ----------
    verb : Verb
    result : message
    cancelled : bool
        Whether the action ended as canceled.
    image : Image, optional
        Of a Scan: what its lines came to.
    """
    status = COMPLETE if result.success else CANCELLED if cancelled else FAILED
    return Outcome(status, result.message, _result(verb, result, image))


def _result(verb: Verb, result: Any, image: Image | None) -> Any:
    if isinstance(result, action.Verb.Result):
        found = _arrays(result)
        if verb.returns is Image:
            if image is not None and found.attributes:
                image.take_notes(found.attributes)
            return image
        if verb.returns is not Standing:
            return found
        # A verb that was refused stands nowhere.
        if not found.variables:
            return None
        return Standing(**{name: each.values.item() for name, each in found.variables.items()})
    if verb.returns is Image:
        if image is not None:
            image.line_rate, image.start = result.line_rate, result.start
            image.metadata = values_of(result.metadata)
        return image
    if several := get_args(verb.returns):
        (name,) = set(result.get_fields_and_field_types()) - set(_TOLD)
        return [_decoded(several[0], each, verb=verb) for each in getattr(result, name)]
    # A number without a unit: none was found.
    return None if getattr(result, "unit", "1") == "" else _decoded(verb.returns, result, verb=verb)


# Dataclasses and messages with fields of the same names; a mapping is a list of parameters, or of texts with keys.


def _put(found: Any, message: Any) -> Any:
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(found, name, None)
        if name not in _TOLD and value is not None and not isinstance(value, Verb):
            if kind == "sequence<diagnostic_msgs/KeyValue>":
                value = [KeyValue(key=key, value=text) for key, text in value.items()]
            else:
                value = parameters(value) if kind == "sequence<rcl_interfaces/Parameter>" else _encoded(value)
            setattr(message, name, value)
    return message


def _encoded(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return numbers(value)
    if isinstance(value, TimeSeries):
        units, data = [value.units[name] for name in value.channels], numbers(*value.channels.values())
        return msg.Record(time=numbers(value.time), channels=list(value.channels), units=units, data=data)
    if dataclasses.is_dataclass(value):
        return _put(value, getattr(msg, type(value).__name__)())
    return python_value(value)


def _decoded(kind: Any, message: Any, **given: Any) -> Any:
    if kind is TimeSeries:
        return TimeSeries(np.array(message.time, np.float64), *channels_of(message, len(message.time)))
    values = {}
    for name, hint in get_type_hints(kind).items():
        if name in given:
            values[name] = given[name]
        elif get_origin(hint) is Mapping:
            values[name] = values_of(getattr(message, name))
        else:
            value = getattr(message, name)
            nested = dataclasses.is_dataclass(hint)
            values[name] = _decoded(hint, value) if nested else _plain(value)
    return kind(**values)


def _plain(value: Any) -> Any:
    return value if isinstance(value, str | bool | int | float) else np.array(value, np.float64)


def numbers(*arrays: Any) -> Any:
    """Arrays one after the other as the messages hold them, without a Python object for each number."""
    found = array.array("d")
    for values in arrays:
        found.frombytes(np.ascontiguousarray(values, np.float64).data.cast("B") if np.size(values) else b"")
    return found


def parameters(values: Mapping[str, Any]) -> list[ParameterMessage]:
    """Numbers, texts and lists as they go over topics, with their names; `decoding.values_of` is the inverse."""
    return [Parameter(name, value=_parameter_value(value)).to_parameter_msg() for name, value in values.items()]


def _parameter_value(value: Any) -> Any:
    if isinstance(value, str) or not hasattr(value, "__len__"):
        return python_value(value)
    each = [python_value(one) for one in value]
    # A list has one type.
    return [float(one) for one in each] if any(isinstance(one, float) for one in each) else each


def lines_done(result: Any) -> int:
    """Lines of a scan, or of a verb that is one, by the result of its action."""
    if isinstance(result, action.Verb.Result):
        return int(values_of(result.attributes).get("lines_done", 0))
    return int(result.lines_done)


# Named arrays.


def _put_arrays(arrays: Arrays, result: Any) -> None:
    result.attributes = parameters(arrays.attributes)
    result.arrays.extend(named_arrays(arrays))


def named_arrays(arrays: Arrays) -> list[NamedArray]:
    """Arrays as messages, one each."""
    found = []
    for coordinate, group in ((False, arrays.variables), (True, arrays.coordinates)):
        for name, (dims, values, attributes) in group.items():
            message = NamedArray(name=name, coordinate=coordinate, dimensions=list(dims), shape=list(values.shape))
            message.attributes = parameters(attributes)
            if values.dtype.kind == "U":
                message.words = values.ravel().tolist()
            else:
                message.data = numbers(values.ravel())
            found.append(message)
    return found


def _arrays(result: Any) -> Arrays:
    groups: tuple[dict[str, Variable], dict[str, Variable]] = ({}, {})
    for each in result.arrays:
        groups[each.coordinate][each.name] = variable_of(each)
    return Arrays(*groups, values_of(result.attributes))
