"""What remains: bias, gains, ranges, drift, motors, oscilloscopes, resonance, files, versions."""

import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from afm_model.microscope import to_xarray

from .codec import ProtocolError
from .front import Front
from .handlers import handles
from .jobs import SPECTRUM, Work
from .motion import limit

RELEASE = 15632
"""Of the software that clients are to take this for: they choose layouts by it."""
_BASES = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0]
"""Time bases of the oscilloscopes [s]."""
_OSCI = 128
"""Values of an oscilloscope."""
_GAINS = ["LN 10^6", "LN 10^7", "LN 10^8", "LN 10^9"]
_FILTERS = ["Full BW", "10 kHz", "1 kHz"]
_LONGEST_PULSE = 10.0
_NOT_HERE = "Module not available"


@handles("Bias.RangeGet")
def _bias_ranges(front: Front) -> list[Any]:
    return [["10 V"], 0]


@handles("Bias.Pulse")
def _pulse(front: Front, wait: int, width: float, bias: float, hold: int, absolute: int) -> list[Any]:
    if wait:
        time.sleep(min(max(width, 0.0), _LONGEST_PULSE))
    return []


@handles("Current.GainsGet")
def _gains(front: Front) -> list[Any]:
    return [_GAINS, front.numbers.gain, _FILTERS, front.numbers.filter]


@handles("Current.GainSet")
def _set_gain(front: Front, gain: int, filter_index: int) -> list[Any]:
    numbers = front.numbers
    numbers.gain = gain if gain >= 0 else numbers.gain
    numbers.filter = filter_index if filter_index >= 0 else numbers.filter
    return []


@handles("Piezo.RangeGet")
def _ranges(front: Front) -> list[Any]:
    return list(front.ranges)


@handles("Piezo.RangeSet")
def _set_ranges(front: Front, x: float, y: float, z: float) -> list[Any]:
    if not min(x, y, z) > 0.0:
        raise ProtocolError(f"ranges of {x:g} m, {y:g} m, {z:g} m are not allowed: all must be > 0 m")
    limit(front, 0.5 * z, -0.5 * z)
    front.ranges = [x, y, z]
    return []


@handles("Piezo.CalibrGet")
def _sensitivities(front: Front) -> list[Any]:
    return front.kept("Piezo.SensGet")


@handles("Piezo.DriftCompSet")
def _set_drift(front: Front, on: int, x: float, y: float, z: float, most: float) -> list[Any]:
    numbers = front.numbers
    numbers.drift = (int(on == 1) if on else numbers.drift[0], x, y, z, most or numbers.drift[4])
    return []


@handles("Piezo.DriftCompGet")
def _drift(front: Front) -> list[Any]:
    on, x, y, z, most = front.numbers.drift
    return [on, x, y, z, 0, 0, 0, most]


@handles("Piezo.HVAInfoGet")
def _amplifier(front: Front) -> list[Any]:
    return [15.0, 15.0, 15.0, 15.0, 1, 1, 1]


@handles("TipRec.DataGet")
def _recorded(front: Front) -> list[Any]:
    return [[0], np.zeros((1, 1))]


@handles("Motor.PosGet", "Motor.StepCounterGet")
def _motor(front: Front, *given: int) -> list[Any]:
    raise ProtocolError("not available with this motor")


@handles("Motor.FreqAmpSet")
def _set_motor(front: Front, frequency: float, amplitude: float, axis: int) -> list[Any]:
    front.numbers.motor = (frequency, amplitude)
    return []


@handles("Motor.FreqAmpGet")
def _motor_drive(front: Front, axis: int) -> list[Any]:
    return list(front.numbers.motor)


@handles("Util.VersionGet")
def _version(front: Front) -> list[Any]:
    return ["Nanonis SPM Control Software", "Generic 5", RELEASE, RELEASE]


@handles("Util.SessionPathGet")
def _folder(front: Front) -> list[Any]:
    return [str(front.folder)]


@handles("Util.SessionPathSet")
def _set_folder(front: Front, path: str, save: int) -> list[Any]:
    try:
        there = Path(path).is_dir()
    except (OSError, ValueError):
        there = False
    if not there:
        raise ProtocolError(f"Session Path not valid. There is no folder {path[:200]!r}")
    front.folder = Path(path).absolute()
    return []


@handles("DataLog.PropsGet")
def _log_props(front: Front) -> list[Any]:
    return front.kept("DataLog.PropsSet")[:7]


@handles("DataLog.StatusGet")
def _log_status(front: Front) -> list[Any]:
    return ["", 0, 0, 0.0, "", "", 0]


def _with_base(module: str) -> None:
    """Handlers of the time base of an oscilloscope."""

    @handles(f"{module}.TimebaseSet")
    def set_base(front: Front, index: int) -> list[Any]:
        if index >= 0:
            front.numbers.bases[module] = min(index, len(_BASES) - 1)
        return []

    @handles(f"{module}.TimebaseGet")
    def base(front: Front) -> list[Any]:
        return [front.numbers.bases[module], _BASES]


_with_base("Osci1T")
_with_base("Osci2T")


def _trace(front: Front, indices: list[int], base: float) -> tuple[float, NDArray[np.float64]]:
    """Step of time [s], and signals (indices, values) one after the other."""
    step = base / _OSCI
    found = []
    for _ in range(_OSCI):
        found.append(front.signals.values(indices))
        time.sleep(step)
    return step, np.array(found).T


@handles("Osci1T.DataGet")
def _osci1(front: Front, which: int) -> list[Any]:
    step, (values,) = _trace(front, front.kept("Osci1T.ChGet"), _BASES[front.numbers.bases["Osci1T"]])
    return [0.0, step, values]


@handles("Osci2T.DataGet")
def _osci2(front: Front, which: int) -> list[Any]:
    step, (first, second) = _trace(front, front.kept("Osci2T.ChsGet"), _BASES[front.numbers.bases["Osci2T"]])
    return [0.0, step, first, second]


def _with_gains(loop: str, before: tuple[float, float]) -> None:
    """Handlers of P and time constant of a loop of the PLL."""

    @handles(f"PLL.{loop}CtrlGainSet")
    def set_gain(front: Front, index: int, proportional: float, constant: float) -> list[Any]:
        front.numbers.pll_gains[loop, index] = (proportional, constant)
        return []

    @handles(f"PLL.{loop}CtrlGainGet")
    def gain(front: Front, index: int) -> list[Any]:
        proportional, constant = front.numbers.pll_gains.get((loop, index), before)
        return [proportional, constant, proportional / constant if constant else 0.0]


_with_gains("Amp", (1e-3, 1e-3))
_with_gains("Phas", (1.0, 1e-3))


@handles("PLL.FreqShiftAutoCenter")
def _centre(front: Front, index: int) -> list[Any]:
    # The official force curve has 0 for the first one.
    return []


@handles("PLLFreqSwp.Stop")
def _stop_sweep(front: Front, index: int) -> list[Any]:
    front.jobs.stop(SPECTRUM)
    return []


@handles("PLLFreqSwp.Start")
def _sweep(front: Front, index: int, get: int, upwards: int) -> list[Any]:
    if not hasattr(front.parameters.onboard, "lock_in"):
        raise ProtocolError(f"{_NOT_HERE}: nothing drives the cantilever of this microscope; start one that taps")
    points, _, _ = front.kept("PLLFreqSwp.ParamsGet", 1)
    found: dict[str, Any] = {}

    def prepare() -> Work:
        return lambda: found.update(tuned=to_xarray(front.do("tune", points=max(points, 5))))

    front.jobs.finish(front.jobs.start(SPECTRUM, prepare))
    tuned = found["tuned"]
    frequency = np.asarray(tuned.frequency)
    numbers = {name: float(value) for name, value in tuned.attrs.items() if isinstance(value, int | float)}
    resonance = numbers.get("f0_Hz", float(frequency[np.argmax(np.asarray(tuned.amplitude))]))
    phase = np.degrees(np.asarray(tuned.phase))
    rows = [frequency - resonance, np.asarray(tuned.amplitude), phase, np.ones(len(frequency))]
    rows = rows if upwards else [row[::-1] for row in rows]
    names = ["Frequency Shift (Hz)", "Amplitude (m)", "Phase (deg)", "Excitation (V)"]
    return [
        *(names, np.stack(rows), resonance, numbers.get("Q", 0.0)),
        *(float(np.interp(resonance, frequency, phase)), 1.0, len(frequency), len(frequency)),
    ]
