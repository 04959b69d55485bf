"""Verbs and what they bring back as actions of afm_msgs, both ways: the same names, fields and units."""

import array
import math
import re
from typing import Any

import numpy as np
from afm_msgs import action
from afm_msgs.msg import Curve as CurveMessage
from afm_msgs.msg import Record as RecordMessage
from numpy.typing import NDArray

from afm_model.analysis import Estimate
from afm_model.core.errors import ParameterError
from afm_model.core.schema import build
from afm_model.microscope.results import (
    CANCELLED,
    COMPLETE,
    FAILED,
    Calibration,
    Curve,
    Image,
    Loop,
    Outcome,
    PathRecord,
    Record,
    Standing,
)
from afm_model.microscope.verbs import VERBS, ScanPath, Verb

_Array = NDArray[np.float64]


def topic(name: str) -> str:
    """Name of the action of a verb: `move_to` of `MoveTo`."""
    return re.sub("(?<!^)(?=[A-Z])", "_", name).lower()


TOPICS = {name: topic(name) for name in VERBS}
"""Names of the actions, by those of the verbs."""


def type_of(name: str) -> Any:
    """Type of the action of a verb."""
    return getattr(action, name)


def goal_of(verb: Verb) -> Any:
    """A verb as a goal of its action."""
    goal = type_of(type(verb).__name__).Goal()
    for name in type(verb).model_fields:
        value = getattr(verb, name)
        setattr(goal, name, list(value) if isinstance(value, tuple) else value)
    return goal


def verb_of(name: str, goal: Any) -> Verb:
    """The verb called `name` that a goal asks for.

    Raises
    ------
    ParameterError
        If a value is not allowed: one sentence.
    """
    verb = VERBS[name]
    values = {field: getattr(goal, field) for field in verb.model_fields}
    for axis in ("x", "y") if verb is ScanPath else ():
        values[axis] = _places(axis, values[axis])
    return build(verb, values)


def _places(axis: str, values: Any) -> tuple[float, ...]:
    for i, value in enumerate(values):
        if not math.isfinite(value):
            raise ParameterError(f"{axis}[{i}] = {value:g} m is not allowed: it must be a finite number")
    return tuple(values)


def put_outcome(outcome: Outcome, result: Any) -> Any:
    """Write how a verb has ended into the result of its action, with all that was measured; the lines of a scan are
    sent on a topic of their own.
    """
    result.success, result.message = outcome.status == COMPLETE, outcome.message
    found = outcome.result
    if isinstance(found, Standing):
        for name in ("time", "x", "y", "z", "deflection"):
            setattr(result, name, getattr(found, name))
    elif isinstance(found, Image):
        result.lines_done, result.line_rate, result.start = found.lines_done, found.line_rate, found.start
        result.metadata_names, result.metadata_values = list(found.metadata), list(found.metadata.values())
    elif isinstance(found, Loop):
        for name in ("position", "lateral", "deflection", "time"):
            setattr(result, name, _numbers(getattr(found, name)))
    elif isinstance(found, PathRecord):
        result.record = _record_message(found.record)
    elif isinstance(found, Calibration):
        result.value, result.uncertainty = found.estimate
        result.unit = found.unit
        result.details_names = list(found.details)
        result.details_values = list(map(float, found.details.values()))
    elif found:
        result.curves = [_curve_message(curve) for curve in found]
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
    if hasattr(result, "lines_done"):
        if image is not None:
            image.line_rate, image.start = result.line_rate, result.start
            image.metadata = dict(zip(result.metadata_names, result.metadata_values, strict=True))
        return image
    if hasattr(result, "curves"):
        return [_curve(message) for message in result.curves]
    if hasattr(result, "record"):
        assert isinstance(verb, ScanPath)
        return PathRecord(verb, _record(result.record))
    if hasattr(result, "uncertainty"):
        if not result.unit:
            return None
        details = dict(zip(result.details_names, result.details_values, strict=True))
        return Calibration(Estimate(result.value, result.uncertainty), result.unit, details)
    if hasattr(result, "lateral"):
        names = ("position", "lateral", "deflection", "time")
        return Loop(verb, *(np.array(getattr(result, name), np.float64) for name in names))  # type: ignore[arg-type]
    return Standing(result.time, result.x, result.y, result.z, result.deflection)


def _numbers(values: Any) -> Any:
    """As the messages hold them, without a Python object for each."""
    return array.array("d", np.ascontiguousarray(values, np.float64).tobytes())


def _record_message(record: Record) -> Any:
    data = np.concatenate([np.zeros(0), *record.channels.values()])
    units = [record.units[name] for name in record.channels]
    return RecordMessage(time=_numbers(record.time), channels=list(record.channels), units=units, data=_numbers(data))


def _record(message: Any) -> Record:
    time = np.array(message.time, np.float64)
    data = np.array(message.data, np.float64).reshape(len(message.channels), len(time))
    channels = dict(zip(message.channels, data, strict=True))
    return Record(time, channels, dict(zip(message.channels, message.units, strict=True)))


_OF_CURVE = (
    *("triggered", "x", "y", "approach_rate", "retract_rate"),
    *("deflection_sensitivity", "spring_constant", "trigger"),
)


def _curve_message(curve: Curve) -> Any:
    plain = {name: getattr(curve, name) for name in _OF_CURVE} | {"triggered": bool(curve.triggered)}
    return CurveMessage(record=_record_message(curve.record), **plain)


def _curve(message: Any) -> Curve:
    return Curve(_record(message.record), **{name: getattr(message, name) for name in _OF_CURVE})
