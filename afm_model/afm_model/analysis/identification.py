"""Resonance, damping and sensitivity of the scanner from a run with the tip off the sample.

Each axis is a resonator driven by a voltage that is held over the control period (docs/theory.md (19) without contact):

    x'' + 2 xi w x' + w^2 x = w^2 sensitivity u,    w = 2 pi f

For a held drive its motion at the ticks is exact in closed form. The three numbers are those for which that motion
comes nearest to what the position sensors read, in the sense of least squares. Noise of the sensors then makes no
systematic error, as it does in a fit of the difference equation.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.signal import lfilter

from ..core.errors import ParameterError
from .estimate import Estimate, together

_Array = NDArray[np.float64]
AXES = "xyz"
LEAST_FIT = 0.95
"""Part of the motion that the resonator must explain."""
_MOST_STEPS = 50
"""Of a fit; a record of a resonator takes ten."""
_LEAST_TICKS = 100
_TRIED_DAMPING = (0.003, 0.01, 0.03, 0.1, 0.3)


@dataclass(frozen=True)
class Resonator:
    """One axis of the scanner."""

    f: Estimate  # resonance [Hz]
    xi: Estimate  # damping ratio
    sensitivity: Estimate  # static displacement per volt [m/V]
    fit: float  # 1 - rms of the residuals over rms of the motion


def response(drive: _Array, period: float, f: float, xi: float, sensitivity: float) -> _Array:
    """Motion of a resonator at the ticks, from rest, under a drive held from each tick to the next.

    Parameters
    ----------
    drive : ndarray (n,) [V]
        Applied from each tick on, as the difference to the one at rest.
    period : float [s]
    f, xi, sensitivity : float [Hz], [1], [m/V]

    Returns
    -------
    ndarray (n,) [m]
        At the ticks; the first is 0.
    """
    w = 2.0 * math.pi * f
    A = np.array([[0.0, 1.0, 0.0], [-w * w, -2.0 * xi * w, w * w * sensitivity], [0.0, 0.0, 0.0]])
    M = expm(A * period)
    phi, gamma = M[:2, :2], M[:2, 2]
    # Transfer function of position from drive: C (z - phi)^-1 gamma.
    numerator = [0.0, gamma[0], phi[0, 1] * gamma[1] - phi[1, 1] * gamma[0]]
    denominator = [1.0, -(phi[0, 0] + phi[1, 1]), phi[0, 0] * phi[1, 1] - phi[0, 1] * phi[1, 0]]
    return np.asarray(lfilter(numerator, denominator, drive), np.float64)


def fit_resonator(drive: _Array, position: _Array, period: float) -> Resonator:
    """Find the resonator that moves so under such a drive.

    Parameters
    ----------
    drive : ndarray (n,) [V]
        Applied from each tick on; it must begin at rest.
    position : ndarray (n,) [m]
        At the ticks, as the sensor reads it.
    period : float [s]
        Between two ticks.

    Raises
    ------
    ParameterError
        If the record is too short, is not excited, or is not the motion of a resonator.
    """
    if len(drive) != len(position) or len(drive) < _LEAST_TICKS:
        raise ParameterError(
            f"{len(drive)} drives and {len(position)} positions are not enough to identify an axis: take as many of "
            f"both, at least {_LEAST_TICKS}"
        )
    if not (np.isfinite(drive).all() and np.isfinite(position).all()):
        raise ParameterError("a record with gaps cannot be identified: every drive and position must be finite")
    u, x = drive - drive[0], position - position[0]
    if not u.any() or not x.any():
        raise ParameterError(
            "an axis that is not driven, or does not move, cannot be identified (does the tip hold it?)"
        )
    try:
        return _fit(u, x, period)
    except (ArithmeticError, np.linalg.LinAlgError, _Undetermined):
        raise ParameterError(
            f"{len(u)} ticks in {len(u) * period:.3g} s do not determine a resonator: take a run of at least ten "
            "periods of the resonance, with the tip off the sample"
        ) from None


class _Undetermined(Exception):
    """The fit has not come to an end, or its numbers may be anything."""


def _fit(u: _Array, x: _Array, period: float) -> Resonator:
    def residual(q: _Array) -> _Array:
        # Unknowns of order 1; a constant offset is the noise of the first reading.
        motion = response(u, period, math.exp(q[0]), math.exp(q[1]), q[2] * scale)
        return np.asarray((motion + q[3] * spread - x) / spread, np.float64)

    spread = float(x.std())
    scale = spread / float(u.std())
    peak = _peak(u, x, period)
    starts = [np.array([math.log(peak), math.log(xi), 2.0 * xi, 0.0]) for xi in _TRIED_DAMPING]
    start = min(starts, key=lambda q: float(np.square(residual(q)).sum()))
    found = least_squares(residual, start, x_scale=(0.01, 0.1, 0.1, 0.1), max_nfev=_MOST_STEPS)
    fit = 1.0 - math.sqrt(2.0 * found.cost / len(x))
    if not fit >= LEAST_FIT:
        raise ParameterError(
            f"the motion is not that of a resonator: it explains {100.0 * fit:.3g} % of it, and "
            f"{100.0 * LEAST_FIT:g} % are needed (is the tip off the sample, is the noise small?)"
        )
    if not found.success:
        raise _Undetermined
    f, xi, sensitivity = math.exp(found.x[0]), math.exp(found.x[1]), float(found.x[2]) * scale
    # What each sample adds to each number, whose noise may be correlated; the fit has taken what adds up to nothing.
    added = np.linalg.inv(found.jac.T @ found.jac) @ found.jac.T * found.fun
    errors = [math.sqrt(float(each @ each) * max(together(each), 1.0)) for each in added[:3]]
    relative, of_xi, of_scale = errors
    if not relative < 1.0:
        raise _Undetermined
    return Resonator(Estimate(f, f * relative), Estimate(xi, xi * of_xi), Estimate(sensitivity, scale * of_scale), fit)


def _peak(u: _Array, x: _Array, period: float) -> float:
    """Frequency at which the motion is largest against the drive [Hz], of those that the drive holds."""
    drive, motion = np.abs(np.fft.rfft(u)), np.abs(np.fft.rfft(x))
    frequency = np.fft.rfftfreq(len(u), period)
    excited = drive > 0.2 * drive[1:].max()
    excited[0] = False
    return float(frequency[excited][np.argmax(motion[excited] / drive[excited])])


@dataclass(frozen=True)
class IdentifiedScanner:
    """What was identified of a scanner: axes x, y, z."""

    x: Resonator
    y: Resonator
    z: Resonator

    def parameters(self) -> dict[str, Estimate]:
        """By the names of the parameters: `scanner.f_x`, `scanner.xi_x`, `piezo.sensitivity_x` and so on."""
        places = {"f": "scanner", "xi": "scanner", "sensitivity": "piezo"}
        return {
            f"{group}.{name}_{axis}": getattr(getattr(self, axis), name)
            for name, group in places.items()
            for axis in AXES
        }


def identify(drive: _Array, position: _Array, period: float) -> IdentifiedScanner:
    """Identify the scanner from a run with the tip off the sample.

    Parameters
    ----------
    drive : ndarray (n, 3) [V]
        Applied from each tick on: `Simulation.drive`, `Recording.drive`. It begins at rest.
    position : ndarray (n, 3) [m]
        As the sensors read it: `Simulation.position`, `Recording.position`.
    period : float [s]
        Control period.

    Raises
    ------
    ParameterError
        As `fit_resonator`, with the axis named.
    """
    found = []
    for i, axis in enumerate(AXES):
        try:
            found.append(fit_resonator(drive[:, i], position[:, i], period))
        except ParameterError as error:
            raise ParameterError(f"along {axis}: {error}") from None
    return IdentifiedScanner(*found)


def write_parameters(scanner: IdentifiedScanner, path: Path, others: Mapping[str, str] | None = None) -> None:
    """Write a parameter file for the controller, to be loaded by `--params-file` or `--overrides`.

    Parameters
    ----------
    scanner : IdentifiedScanner
    path : Path
    others : mapping, optional
        Lines for the comment at its head, by name: where it comes from.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    lines = [f"# {name}: {text}" for name, text in (others or {}).items()]
    lines += ["/**/afm_controller_node:", "  ros__parameters:"]
    for group in ("scanner", "piezo"):
        lines.append(f"    {group}:")
        for name, each in scanner.parameters().items():
            if name.startswith(group):
                lines.append(f"      {name.partition('.')[2]}: {each.value!r}  # +- {each.uncertainty:.2g}")
    path.write_text("\n".join(lines) + "\n")
