"""Resonance of a cantilever whose base is shaken, from a curve of in-phase part and quadrature over frequency."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .estimate import Estimate, same_length, student

_FEWEST = 8


def lag(response: ArrayLike) -> NDArray[np.float64]:
    """Phase phi of A exp(-i phi) [rad], from -pi/2 to 3 pi/2: what lags by 0 to pi has no jump."""
    late = -np.angle(np.asarray(response))
    return np.where(late < -0.5 * np.pi, late + 2.0 * np.pi, late)


@dataclass(frozen=True)
class ResonanceFit:
    """One resonance, as found."""

    f0: Estimate  # [Hz]; of the mode without damping
    Q: Estimate
    amplitude: Estimate  # at f0, in the unit of the response
    phase: Estimate  # lag at f0 [rad], from -pi/2 to 3 pi/2
    response: NDArray[np.complex128]  # the fitted curve at the given frequencies


def resonance_fit(frequency: ArrayLike, response: ArrayLike) -> ResonanceFit:
    """Resonance of one mode of a cantilever whose base is shaken, from what the photodiode shows.

    Least squares of r^2 (C / (1 - r^2 + i r / Q) + D), r = f / f0: with C gain and phase of the drive are free, with D
    other modes, far off, are taken away. Uncertainties follow from the scatter about the curve, which may be larger
    near the resonance, as thermal noise is (MacKinnon and White, J. Econometrics 29 (1985) 305, HC3).

    Parameters
    ----------
    frequency : array_like (n,) [Hz]
    response : array_like of complex (n,)
        A exp(-i phi) of the deflection A cos(2 pi f t - phi): in-phase part less i times quadrature. Settled, of equal
        drive at all frequencies, each measured for equally long.

    Raises
    ------
    ValueError
        If there are fewer than eight points, or no resonance among them.
    """
    from scipy.optimize import least_squares  # here: a recorder needs none

    f = np.asarray(frequency, np.float64)
    given = np.asarray(response, np.complex128)
    same_length(frequency=f, response=given.real)
    if f.size < _FEWEST or not (np.isfinite(f) & np.isfinite(given)).all() or f.min() <= 0.0:
        raise ValueError(f"a resonance needs {_FEWEST} finite points at positive frequencies: there are {f.size}")
    size = float(np.abs(given).max())
    if size == 0.0:
        raise ValueError("no resonance found: the response is 0 everywhere")
    y = given / size
    order = np.argsort(f)
    top = float(f[np.argmax(np.abs(y))])
    above = np.abs(y)[order] > math.sqrt(0.5)
    spacing = np.gradient(f[order]) if f.size > 1 else np.ones(1)
    width = max(float(spacing[above].sum()), float(spacing.min()))

    def parts(f0: float, Q: float) -> NDArray[np.complex128]:
        r = f / f0
        return np.column_stack([r * r / (1.0 - r * r + 1j * r / Q), r * r])

    def curve(p: NDArray[np.float64]) -> NDArray[np.complex128]:
        f0, Q = top * math.exp(p[0]), math.exp(p[1])
        return parts(f0, Q) @ np.array([complex(p[2], p[3]) / Q, complex(p[4], p[5])])

    def left(p: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((curve(p) - y).view(np.float64))

    Q = top / width
    gains = np.linalg.lstsq(parts(top, Q), y, rcond=None)[0]
    start = [0.0, math.log(Q), Q * gains[0].real, Q * gains[0].imag, gains[1].real, gains[1].imag]
    found = least_squares(left, start, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    f0, Q = top * math.exp(found.x[0]), math.exp(min(found.x[1], 300.0))
    if not (found.success and f.min() < f0 < f.max() and Q < 1e9):
        raise ValueError(f"no resonance found from {f.min():.5g} to {f.max():.5g} Hz: the best fit's is at {f0:.5g} Hz")
    slopes, scatter = found.jac, found.fun
    inverse = np.linalg.pinv(slopes.T @ slopes)
    leverage = np.clip(np.einsum("ij,jk,ik->i", slopes, inverse, slopes), 0.0, 0.99)
    weighted = slopes * (scatter / (1.0 - leverage))[:, None]
    factor = student(2.0 * f.size - 6.0)
    covariance = inverse @ weighted.T @ weighted @ inverse * factor**2
    error = np.sqrt(np.diag(covariance))
    # At f0 the response is -i Q C + D.
    at_f0 = complex(found.x[3] + found.x[4], found.x[5] - found.x[2])
    by = np.array([[0.0, 0.0, 0.0, 1.0, 1.0, 0.0], [0.0, 0.0, -1.0, 0.0, 0.0, 1.0]])
    unit = at_f0.conjugate() / abs(at_f0)
    turned = np.array([[unit.real, -unit.imag], [unit.imag, unit.real]]) @ by
    along, across = np.sqrt(np.diag(turned @ covariance @ turned.T)).tolist()
    return ResonanceFit(
        Estimate(f0, f0 * float(error[0])),
        Estimate(Q, Q * float(error[1])),
        Estimate(size * abs(at_f0), size * along),
        Estimate(float(lag(at_f0)), across / abs(at_f0)),
        curve(found.x) * size,
    )
