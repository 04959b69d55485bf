"""Spring constant of a cantilever from its thermal noise: fit of a damped oscillator to the spectrum.

Takes a record in volts, from this simulator or from a real microscope. References: Hutter and Bechhoefer,
Rev. Sci. Instrum. 64 (1993) 1868; Butt and Jaschke, Nanotechnology 6 (1995) 1.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..cantilever.tilted import tilted_deflection
from .estimate import Estimate

_Array = NDArray[np.float64]
BOLTZMANN = 1.380649e-23
"""[J/K]."""
FIRST_MODE = 12.0 / 1.8751040687119611**4
"""Part of k_B T / k that is in the first mode of a rectangular cantilever: 0.971."""
SLOPE = 1.5 / 1.3765056
"""chi: deflection of a free end in its first mode over what is shown, 1.090. Shown is the slope of the end: 3/2 of the
deflection over the length under the force with which the sensitivity was measured, 1.3765 in the first mode.
"""
RECTANGULAR = FIRST_MODE / SLOPE**2
"""0.817: spring constant times the mean square shown over k_B T."""
_SEGMENTS = 16
_INDEPENDENT = (2 * _SEGMENTS - 1) / (35.0 / 18.0 + (2.0 * _SEGMENTS - 2.0) / (2.0 * _SEGMENTS - 1.0) / 6.0)
"""Spectra that count as independent. Bins of a Hann window have 4/9 and 1/36 of their variance in common with those one
and two bins away, 35/18 in all; windows that overlap by half 1/12 with all bins of the next one."""
_PASSES = 200
_WIDTHS, _BANDS, _FEWEST = 5.0, 6, 20
"""Widths of the resonance to either side of it that are fitted, times that they are found again, points of a fit."""
_DOUBTFUL = 0.3
"""Relative uncertainty of the variance from which on there is no resonance to speak of."""


class ThermalResult(NamedTuple):
    """Results of a thermal record of a cantilever. Uncertainties are those of the length of the record; that of the
    spring constant has that of the sensitivity in it.
    """

    k: Estimate
    """Spring constant [N/m]."""
    f0: Estimate
    """Resonance [Hz]."""
    Q: Estimate
    """Quality factor."""
    rms: float
    """Of the first mode, as shown [m]."""
    floor: Estimate
    """White noise under the resonance [m/sqrt(Hz)]. Where the resonance covers it the uncertainty is as large."""
    frequency: _Array
    """Of the spectrum in the band of the fit [Hz]."""
    density: _Array
    """Of the deflection shown, one-sided [m^2/Hz]."""
    fitted: _Array
    """Spectral density of the fit [m^2/Hz]."""


def spring_constant(
    voltage: ArrayLike,
    rate: float,
    sensitivity: Estimate | float,
    temperature: float,
    *,
    band: tuple[float, float] | None = None,
    tilt: float = 0.0,
    tip_height: float = 0.0,
    length: float = math.inf,
    correction: float = RECTANGULAR,
) -> ThermalResult:
    """Spring constant from the deflection of a free cantilever: k = correction k_B T / <z^2>.

    The fit is that of largest likelihood (a Whittle likelihood of the averaged spectrum), so that it has no bias from
    the scatter of the spectrum. It takes five widths f0/Q to either side of the resonance: an ADC without a filter
    folds the second mode (6.27 f0, a third of the variance) to anywhere, and its slope would count as the first one's.
    Choose a rate that does not fold it into these widths.

    Parameters
    ----------
    voltage : array_like (n,) [V]
        Deflection signal far from the sample, evenly sampled.
    rate : float [Hz]
        Samples per second.
    sensitivity : Estimate or float [m/V]
        Inverse optical lever sensitivity, from a force curve on a stiff sample. 1 for a record in metres.
    temperature : float [K]
    band : (float, float) [Hz], optional
        Where to look for the resonance; an octave to either side of the peak with the most variance if not given.
    tilt : float [rad]
        Angle of the cantilever to the sample, if the sensitivity is that of a vertical way, as from a force curve: see
        `tilted_deflection`. k is that across the cantilever; for vertical forces take `tilted_stiffness` of it.
    tip_height, length : float [m]
        With a tilt: of the tip below the cantilever's neutral axis; of the cantilever. Left out, the tip is taken as
        low: k is too high by some 2 % then (0.2 rad, a tip of a twentieth of the length).
    correction : float
        Of the first mode and of the slope: 0.817 for a rectangular cantilever and a small spot; 0.971 if deflection
        itself is measured.

    Raises
    ------
    ValueError
        If an argument is not allowed, the record is too short for the resonance, or the band has no resonance.
    """
    from scipy.signal import welch  # here: a third of a second for nothing in a recorder, which needs no spectrum

    voltage = np.asarray(voltage, np.float64)
    per_volt = sensitivity if isinstance(sensitivity, Estimate) else Estimate(sensitivity)
    _require(voltage, rate, per_volt.value, temperature, tilt, correction)
    scale = per_volt.value * tilted_deflection(tilt, tip_height, length)
    length = len(voltage) // _SEGMENTS
    f, density = welch(voltage * scale, rate, nperseg=length, detrend="linear")
    low, high = band if band is not None else _octaves(f, density)
    if not 0.0 <= low < high <= 0.5 * rate:
        raise ValueError(f"band = {low:g} to {high:g} Hz is not allowed: it must lie within 0 to {0.5 * rate:g} Hz")
    inside = (f >= low) & (f <= high) & (f > 0.0)
    f, density = f[inside], density[inside]
    if len(f) < _FEWEST:
        raise ValueError(
            f"the record of {len(voltage) / rate:g} s has {len(f)} points in the band and must have {_FEWEST}"
        )
    resolution = rate / length
    f, density, logs, covariance = _around_resonance(f, density, resolution)
    variance, f0, Q, floor = np.exp(logs).tolist()
    if f0 / Q < 4.0 * resolution:
        raise ValueError(
            f"the record of {len(voltage) / rate:g} s is too short for a resonance {f0 / Q:.3g} Hz wide: it must be at "
            f"least {4.0 * _SEGMENTS * Q / f0:.3g} s"
        )
    k = correction * BOLTZMANN * temperature / variance
    errors = np.sqrt(np.diag(covariance) / _INDEPENDENT).tolist()
    if errors[0] > _DOUBTFUL:
        raise ValueError(
            f"no resonance found from {low:.4g} to {high:.4g} Hz: the best fit's variance is uncertain by "
            f"{100.0 * errors[0]:.0f} %"
        )
    fitted, slopes = _model(f, logs)
    of_k = math.hypot(errors[0], 2.0 * per_volt.uncertainty / per_volt.value)
    return ThermalResult(
        Estimate(k, k * of_k),
        Estimate(f0, f0 * errors[1]),
        Estimate(Q, Q * errors[2]),
        math.sqrt(variance),
        _root_of_floor(floor, fitted, slopes),
        f,
        density,
        fitted,
    )


def _root_of_floor(floor: float, fitted: _Array, slopes: _Array) -> Estimate:
    """Root of the white floor; its uncertainty is the larger one of both sides, since there may be no floor at all."""
    # By the floor itself, not by its logarithm, which has no end where there is none.
    scale = float(fitted.min())
    slopes = np.column_stack([slopes[:, :3], scale / fitted])
    error = scale * math.sqrt(np.linalg.inv(slopes.T @ slopes)[3, 3] / _INDEPENDENT)
    root, below, above = (math.sqrt(max(floor + by, 0.0)) for by in (0.0, -error, error))
    return Estimate(root, max(root - below, above - root))


def _require(
    voltage: _Array, rate: float, sensitivity: float, temperature: float, tilt: float, correction: float
) -> None:
    """Raise ValueError for arguments that are not allowed."""
    if voltage.ndim != 1 or len(voltage) < 1000:
        raise ValueError(f"voltage of shape {voltage.shape} is not allowed: it must be one row of 1000 samples or more")
    if not np.isfinite(voltage).all():
        raise ValueError("voltage is not allowed: it has samples that are not finite numbers")
    if np.ptp(voltage) == 0.0:
        raise ValueError("voltage is not allowed: all samples are equal")
    given = {"rate": rate, "sensitivity": sensitivity, "temperature": temperature, "correction": correction}
    for name, value in given.items():
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} = {value:g} is not allowed: it must be a positive number")
    if not abs(tilt) < 0.5 * math.pi:
        raise ValueError(f"tilt = {tilt:g} rad is not allowed: it must be within +-pi/2")


def _octaves(f: _Array, density: _Array) -> tuple[float, float]:
    """An octave to either side of the peak with the most variance above its surroundings: the first mode, not drift."""
    from scipy.signal import medfilt  # as above

    at = np.digitize(f, np.geomspace(f[1], f[-1], 400))
    count = np.bincount(at)
    filled = count > 0
    mean, place = (np.bincount(at, of)[filled] / count[filled] for of in (density, f))
    above = place * (mean - np.exp(medfilt(np.log(mean), 61)))
    peak = float(place[2 + int(np.argmax(above[2:]))])
    return 0.5 * peak, min(2.0 * peak, float(f[-1]))


def _around_resonance(f: _Array, density: _Array, resolution: float) -> tuple[_Array, _Array, _Array, _Array]:
    """Frequencies and density within some widths of the resonance, and `_fit` of those."""
    f0 = float(f[np.argmax(np.convolve(density, np.ones(9) / 9.0, mode="same"))])
    width = 0.05 * f0
    for _ in range(_BANDS):
        near = np.abs(f - f0) <= max(_WIDTHS * width, _FEWEST * resolution)
        logs, covariance = _fit(f[near], density[near])
        before, f0 = width, math.exp(logs[1])
        width = f0 / math.exp(logs[2])
        if abs(width - before) < 0.05 * width:
            break
    return f[near], density[near], logs, covariance


def _model(f: _Array, logs: _Array) -> tuple[_Array, _Array]:
    """Density of a damped oscillator and a white floor, and its derivatives by `logs` over it (n, 4).

    Parameters
    ----------
    logs : ndarray (4,)
        Logarithms of variance, resonance, quality factor and floor.
    """
    variance, f0, Q, floor = np.exp(logs)
    x = (f / f0) ** 2
    detuned, damped = (1.0 - x) ** 2, x / Q**2
    oscillator = 2.0 * variance / (math.pi * f0 * Q) / (detuned + damped)
    total = oscillator + floor
    by_f0 = oscillator * (-1.0 - (4.0 * x * (1.0 - x) - 2.0 * damped) / (detuned + damped))
    by_Q = oscillator * (-1.0 + 2.0 * damped / (detuned + damped))
    return total, np.column_stack([oscillator, by_f0, by_Q, np.full(len(f), floor)]) / total[:, None]


def _fit(f: _Array, density: _Array) -> tuple[_Array, _Array]:
    """Logarithms of variance, resonance, quality factor, floor; their covariance for one segment.

    Fisher's scoring: the spectrum scatters by its own size, so that the likelihood is largest where the sum of
    (density / model - 1) times the logarithmic derivatives is zero.
    """
    smooth = np.convolve(density, np.ones(9) / 9.0, mode="same")
    top = int(np.argmax(smooth))
    floor = float(np.quantile(density, 0.1))
    variance = float(np.sum(density - floor) * (f[1] - f[0]))
    peak = max(float(smooth[top]) - floor, 1e-300)
    Q = min(max(peak * math.pi * f[top] / (2.0 * variance), 1.0), 1e6)
    logs = np.log([variance, f[top], Q, floor])
    for _ in range(_PASSES):
        model, slopes = _model(f, logs)
        information = slopes.T @ slopes
        change = np.linalg.lstsq(information, slopes.T @ (density / model - 1.0), rcond=None)[0]
        # What is far off is approached in short steps: a floor that is not there would run away.
        logs = logs + np.clip(change, -0.3, 0.3)
        logs[3] = max(logs[3], math.log(peak) - 40.0)
        if np.abs(change[:3]).max() < 1e-8:
            break
    else:
        raise ValueError("no resonance found: the spectrum in the band is not that of an oscillator and a white floor")
    if not f[0] < math.exp(logs[1]) < f[-1]:
        raise ValueError(f"no resonance found: the fit's is at {math.exp(logs[1]):.4g} Hz, outside of the band")
    return logs, np.asarray(np.linalg.pinv(information), np.float64)
