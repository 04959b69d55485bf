"""Verbs and what they bring back as actions of afm_msgs, both ways: by the fields that both declare, of the same names.

A verb of this package has an action of its own. Any other is asked for by the action `verb`, with fields as text and a
result of named arrays.
"""

import array
import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import Any, get_args, get_type_hints

import numpy as np
from afm_msgs import action, msg
from afm_msgs.msg import NamedArray, ScanLine

from afm_model.core import registry
from afm_model.core.errors import ParameterError
from afm_model.core.schema import python_value, specifications
from afm_model.microscope.arrays import Arrays, Variable, arrays_of
from afm_model.microscope.image import Image, Line
from afm_model.microscope.results import CANCELLED, COMPLETE, FAILED, Outcome, Standing, TimeSeries
from afm_model.microscope.verb import Verb, find

ANY = "verb"
"""Name of the action for every verb that has none of its own."""
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
        given = {field: list(value) if isinstance(value, tuple) else value for field, value in values.items()}
        return ACTIONS[name].Goal(**given)
    kind = type(verb)
    known = verb.name in registry.names("verb") and find(verb.name) is kind
    texts = [value if isinstance(value, str) else json.dumps(value) for value in values.values()]
    title = verb.name if known else f"{kind.__module__}:{kind.__qualname__}"
    return ACTIONS[ANY].Goal(verb=title, names=list(values), values=texts)


def verb_of(name: str, goal: Any) -> Verb:
    """The verb that a goal of the action `name` asks for.

    Raises
    ------
    ParameterError
        If there is no such verb, or a value is not allowed: one sentence.
    """
    if name != ANY:
        verb = find(name)
        return verb.of({field: getattr(goal, field) for field in verb.model_fields})
    verb = find(goal.verb)
    words = {spec.name for spec in specifications(verb) if spec.kind is str}
    if len(goal.names) != len(goal.values):
        count = f"{len(goal.names)} names with {len(goal.values)} values"
        raise ParameterError(f"{count} are not allowed: each name needs one value")
    given = zip(goal.names, goal.values, strict=True)
    return verb.of({field: text if field in words else _parsed(text) for field, text in given})


def _parsed(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def put_outcome(outcome: Outcome, result: Any) -> Any:
    """Write how a verb has ended into the result of its action, with all that was measured; the lines of a scan are
    sent on a topic of their own.
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
        if verb.returns is not Standing:
            return found
        return Standing(**{name: each.values.item() for name, each in found.variables.items()})
    if verb.returns is Image:
        if image is not None:
            image.line_rate, image.start = result.line_rate, result.start
            image.metadata = dict(zip(result.metadata_names, result.metadata_values, strict=True))
        return image
    if several := get_args(verb.returns):
        (name,) = set(result.get_fields_and_field_types()) - set(_TOLD)
        return [_decoded(several[0], each) for each in getattr(result, name)]
    # A number without a unit: none was found.
    return None if getattr(result, "unit", "1") == "" else _decoded(verb.returns, result, verb=verb)


# Dataclasses and messages with fields of the same names; a mapping is two lists, `NAME_names` and `NAME_values`.


def _put(found: Any, message: Any) -> Any:
    for name in message.get_fields_and_field_types():
        base, _, part = name.rpartition("_")
        value = getattr(found, name, None)
        if name not in _TOLD and value is not None and not isinstance(value, Verb):
            setattr(message, name, _encoded(value))
        elif part in ("names", "values") and hasattr(found, base):
            mapping = getattr(found, base)
            values = [each if isinstance(each, str) else float(each) for each in mapping.values()]
            setattr(message, name, list(mapping) if part == "names" else values)
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
        elif not hasattr(message, name):
            names, each = (getattr(message, f"{name}_{part}") for part in ("names", "values"))
            values[name] = dict(zip(names, each, strict=True))
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


def channels_of(message: Any, length: int) -> tuple[dict[str, Any], dict[str, str]]:
    """Channels of a message that has `channels`, `units` and `data` one after the other; their units."""
    # A message that has arrived is nobody else's: its numbers are not copied.
    data = np.frombuffer(message.data).reshape(len(message.channels), length)
    units = dict(zip(message.channels, message.units, strict=True))
    return dict(zip(message.channels, data, strict=True)), units


FRAME = (
    *("centre_x", "centre_y", "size_x", "angle", "pixels", "lines"),
    *("line_rate", "overscan", "speed", "slow_axis"),
)
"""Fields of ScanLine that are those of a scan; its `size_y` is the scan's height."""


def line_of(message: ScanLine) -> Line:
    """The line that a message brings."""
    return Line(message.index, message.direction, message.time, channels_of(message, message.pixels)[0])


# Named arrays.


def _put_arrays(arrays: Arrays, result: Any) -> None:
    result.attribute_names, result.attribute_values = _texts(arrays.attributes)
    for coordinate, group in ((False, arrays.variables), (True, arrays.coordinates)):
        for name, (dims, values, attributes) in group.items():
            names, texts = _texts(attributes)
            message = NamedArray(name=name, coordinate=coordinate, dimensions=list(dims), shape=list(values.shape))
            message.attribute_names, message.attribute_values = names, texts
            if values.dtype.kind == "U":
                message.words = values.ravel().tolist()
            else:
                message.data = numbers(values.ravel())
            result.arrays.append(message)


def _texts(attributes: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    return list(attributes), [json.dumps(value) for value in attributes.values()]


def _attributes(message: Any) -> dict[str, Any]:
    return dict(zip(message.attribute_names, map(json.loads, message.attribute_values), strict=True))


def _arrays(result: Any) -> Arrays:
    groups: tuple[dict[str, Variable], dict[str, Variable]] = ({}, {})
    for each in result.arrays:
        values = np.array(each.words) if len(each.words) else np.array(each.data, np.float64)
        made = Variable(tuple(each.dimensions), values.reshape(tuple(each.shape)), _attributes(each))
        groups[each.coordinate][each.name] = made
    return Arrays(*groups, _attributes(result))
