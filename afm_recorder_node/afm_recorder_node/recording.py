"""A recording as arrays in SI units. Needs no ROS and no viewer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from afm_model.core.errors import Sentence
from afm_model.microscope.image import Image

_Array = NDArray[np.float64]
Value = bool | int | float | str | list[bool] | list[int] | list[float] | list[str]


class RecordingError(Sentence, ValueError):
    """A file that is no readable recording; the message names it and says why."""


class DamagedRecording(RecordingError):
    """A file that has changed since it was written."""


class IncompleteRecording(UserWarning):
    """A recording that has no end, as that of a recorder that is still at work, or that lacks a part of its run."""


@dataclass(frozen=True)
class RecordedChannel:
    """A detector channel with its sample times."""

    time: _Array  # (k,) simulated time [s]
    values: _Array  # (k,) in `unit`
    unit: str  # in SI
    scale: float  # `unit` per unit as converted; NaN: not recorded


@dataclass(frozen=True)
class ParameterChange:
    """A parameter that changed during the run."""

    time: float  # simulated [s]
    node: str
    name: str
    old: Value | None  # None: it has not been there
    new: Value


@dataclass(frozen=True, kw_only=True)
class About:
    """What a recording holds in addition to its signals. Quantities are in SI units."""

    parameters: dict[str, dict[str, Value]]  # node, name: value when first seen
    parameter_changes: list[ParameterChange]
    events: list[tuple[float, str]]  # simulated time, text; changes of parameters too
    event_levels: list[str]  # of each of them: INFO, WARN, ERROR
    images: list[Image]  # of the scans, in order; one that was not finished has NaN where it lacks lines
    score: dict[str, Value] | None  # as in afm_msgs/Score; None: the run has not come to one
    complete: bool  # whether its end is there, and nothing is missing
    missing: str  # why it is not complete; empty if it is


@dataclass(frozen=True, kw_only=True)
class Recording(About):
    """A run. n control ticks and m detector samples, sorted by time; NaN where a signal has a gap.

    Quantities are in SI units: s, m, N, V.
    """

    time_ticks: _Array  # (n,) simulated time
    position: _Array  # (n, 3) scanner
    reference: _Array  # (n, 3) x, y of the scanner, z of the tip
    error: _Array  # (n, 3) x, y of the scanner, z of the tip
    drive: _Array  # (n, 3) [V]
    round_trip: _Array  # (n,) wall time from a measurement to its drive
    time_samples: _Array  # (m,) simulated time
    deflection: _Array  # (m,)
    lateral_force: _Array  # (m,) along x
    lateral_force_y: _Array  # (m,)
    normal_force: _Array  # (m,)
    deflection_scale: float  # [m/V] deflection over the photodetector's voltage; NaN: not recorded
    lateral_scale: float  # [N/V]
    channels: dict[str, RecordedChannel]  # by the name of its topic, such as "truth/normal_force"
