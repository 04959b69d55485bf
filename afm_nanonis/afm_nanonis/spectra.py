"""ZSpectr: force curves; and what all spectra have, see `bias`."""

import math
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from afm_model.files.result_files import replacing
from afm_model.microscope.verbs import ForceCurve
from afm_model.microscope.verbs.force_curve import Curve
from afm_model.program.force_curve import APPROACH, RETRACT

from .codec import ProtocolError
from .front import Front
from .handlers import handles
from .jobs import SPECTRUM, Work
from .signal_index import COUNT, VERTICAL
from .spectrum_state import SpectrumState

Array = NDArray[np.float64]
_LEAST_LIFT = 1e-10
"""Way of z before a curve that is to begin where z is [m]."""
_SLOWEST, _FASTEST = 1e-9, 1e-4
"""Of a sweep [m/s]."""
_MOST_POINTS = 1 << 16
_KEYS = {"deflection_voltage": "deflection_voltage", "lateral_voltage": "lateral_voltage", "z": "z"}
"""Channels of a curve that signals are of."""


def _settled(front: Front) -> tuple[float, float]:
    """Rest before a sweep, and time of a point [s]."""
    _, settle, _, settling, integration, *_ = front.kept("ZSpectr.TimingGet")
    return max(settle, 1e-4), max(settling + integration, 1e-6)


def _trigger(front: Front, points: bool) -> float:
    """Rise of the deflection at which the sweep ends [V]; 0: at its end."""
    on, threshold, index, below = front.kept("ZSpectr.RetractGet")
    if not on or not points:
        return 0.0
    if index != VERTICAL or below:
        raise ProtocolError("auto retract is done by the vertical deflection, signal 1, above a threshold, alone")
    return max(front.signals.volts(threshold), 0.0)


def _curve_verb(front: Front, state: SpectrumState) -> tuple[ForceCurve, bool]:
    """The force curve that a sweep is, and whether its forward part is the way to the sample."""
    offset, distance = front.kept("ZSpectr.RangeGet")
    if not (math.isfinite(offset) and math.isfinite(distance) and distance != 0.0):
        raise ProtocolError(
            f"a sweep of {distance:g} m from {offset:g} m is not allowed: it must be finite and not 0 m"
        )
    towards = distance < 0.0
    # The verb begins away from the sample, whichever way is the forward one.
    lift = max(offset if towards else offset + distance, _LEAST_LIFT)
    ramp = abs(distance)
    settle, point = _settled(front)
    rate = min(max(ramp / (state.points * point), _SLOWEST), _FASTEST)
    dwell = max(front.kept("ZSpectr.RetractDelayGet")[0], 0.0)
    trigger = _trigger(front, towards)
    return ForceCurve(
        lift=lift,
        ramp=ramp,
        settle=settle,
        approach_rate=rate,
        retract_rate=rate,
        trigger_voltage=trigger,
        dwell=dwell,
        count=max(state.sweeps, 1),
        sample_rate=min(max(2.0 * state.points * rate / ramp, 1e-3), 1e9),
    ), towards


def _columns(front: Front, state: SpectrumState, curves: list[Curve], towards: bool, lift: float) -> dict[str, Array]:
    """Columns of a spectrum by their titles: means of the curves, over points of equal distance."""
    first = curves[0].record.channels
    begin = float(first["z"][0])
    deepest = min(float(each.record.channels["z"].max()) for each in curves)
    z = np.linspace(begin, deepest, state.points)
    z = z if towards else z[::-1]
    found = {"Z rel (m)": begin + lift - z}
    forward, backward = (APPROACH, RETRACT) if towards else (RETRACT, APPROACH)
    for suffix, phase in (("", forward), (" [bwd]", backward)):
        if suffix and not state.backward:
            continue
        for index in state.channels:
            name, unit = front.signals.named(index)
            found[f"{name}{suffix} ({unit})"] = np.mean([_at(front, index, each, phase, z) for each in curves], axis=0)
    return found


def _at(front: Front, index: int, curve: Curve, phase: int, z: Array) -> Array:
    """A signal at places of z of one way of a curve."""
    constant, source = front.signals.constant(index), front.signals.source(index)
    if constant is None and source.signal not in _KEYS:
        constant = front.signals.values([index])[0]
    if constant is not None:
        return np.full(len(z), constant)
    part = curve.record.channels["phase"] == phase
    there = curve.record.channels["z"][part]
    values = front.signals.scaled(index, curve.record.channels[_KEYS[source.signal]][part])
    order = np.argsort(there, kind="stable")
    return np.interp(z, there[order], values[order])


def header_of(front: Front, kind: str, numbers: dict[str, float]) -> dict[str, str]:
    """Header of a file of a spectrum."""
    now, place = f"{datetime.now():%d.%m.%Y %H:%M:%S}", front.read("x", "y")
    head = {"Experiment": kind, "Saved Date": now, "User": "afm_nanonis", "Date": now}
    every = {"X (m)": place["x"].value, "Y (m)": place["y"].value, "Z (m)": front.z, **numbers}
    return head | {key: f"{value:.9E}" for key, value in every.items()} | {"Z-Ctrl hold": "TRUE"}


def _save(front: Front, base: str, header: dict[str, str], columns: dict[str, Array]) -> None:
    """Write a spectrum as .dat under the next free number."""
    lines = [*(f"{key}\t{value}\t" for key, value in header.items()), "", "[DATA]", "\t".join(columns)]
    with (
        replacing(front.free_path(base, 5, ".dat"), ".dat") as beside,
        beside.open("w", encoding="ascii", errors="replace", newline="\r\n") as file,
    ):
        file.write("\n".join(lines) + "\n")
        np.savetxt(file, np.stack([*columns.values()], axis=1), fmt="%.9E", delimiter="\t")


def run_spectrum(front: Front, module: str, get: int, base: str, work: Any) -> list[Any]:
    """Run a spectrum and wait for its end; what Start returns."""
    state = front.spectra[module]
    if base and Path(base).name != base:
        raise ProtocolError(f"base name {base!r} is not allowed: it must be a name of a file")
    state.base = base or state.base
    found: dict[str, Any] = {}

    def prepare() -> Work:
        made = work(state)

        def run() -> None:
            header, columns = made()
            if state.autosave:
                _save(front, state.base, header, columns)
            found.update(columns)

        return run

    front.jobs.finish(front.jobs.start(SPECTRUM, prepare))
    if not get:
        return [[], [], []]
    return [list(found), np.stack([*found.values()]), []]


@handles("ZSpectr.Start")
def _start(front: Front, get: int, base: str) -> list[Any]:
    def work(state: SpectrumState) -> Any:
        verb, towards = _curve_verb(front, state)
        if objection := front.microscope.objection(verb):
            raise ProtocolError(objection)
        offset, distance = front.kept("ZSpectr.RangeGet")

        def run() -> Any:
            curves = front.do(verb)
            numbers = {"Z offset (m)": offset, "Z sweep distance (m)": distance}
            header = header_of(front, "Z spectroscopy", numbers | {"Final Z (m)": front.z})
            return header, _columns(front, state, curves, towards, verb.lift)

        return run

    return run_spectrum(front, "ZSpectr", get, base, work)


@handles("ZSpectr.Stop", "BiasSpectr.Stop")
def _stop(front: Front) -> list[Any]:
    front.jobs.stop(SPECTRUM, soon=True)
    return []


@handles("ZSpectr.StatusGet", "BiasSpectr.StatusGet")
def _status(front: Front) -> list[Any]:
    return [int(front.jobs.doing == SPECTRUM)]


def with_channels(module: str) -> None:
    """Handlers of the signals that spectra of a module record."""

    @handles(f"{module}.ChsSet")
    def set_channels(front: Front, channels: list[int]) -> list[Any]:
        if wrong := [index for index in channels if not 0 <= index < COUNT]:
            raise ProtocolError(f"signal {wrong[0]} is not allowed: it must be 0 to {COUNT - 1}")
        front.spectra[module].channels = list(dict.fromkeys(channels)) or front.spectra[module].channels
        return []

    @handles(f"{module}.ChsGet")
    def get_channels(front: Front) -> list[Any]:
        channels = front.spectra[module].channels
        return [channels, [front.signals.title(index) for index in channels]]


with_channels("ZSpectr")


def take(state: SpectrumState, points: int, **flags: int) -> None:
    """Take the properties that are given: 0 leaves one as it is, 1 is on, 2 is off."""
    if points > _MOST_POINTS:
        raise ProtocolError(f"{points} points are not allowed: at most {_MOST_POINTS}")
    state.points = max(points, 2) if points > 0 else state.points
    for name, flag in flags.items():
        if flag:
            setattr(state, name, int(flag == 1))


@handles("ZSpectr.PropsSet")
def _set_props(
    front: Front, backward: int, points: int, sweeps: int, autosave: int, dialog: int, save_all: int
) -> list[Any]:
    state = front.spectra["ZSpectr"]
    take(state, points, backward=backward, autosave=autosave, dialog=dialog, save_all=save_all)
    state.sweeps = sweeps or state.sweeps
    return []


@handles("ZSpectr.PropsGet")
def _props(front: Front) -> list[Any]:
    state = front.spectra["ZSpectr"]
    return [state.backward, state.points, [], [], state.sweeps, state.save_all]
