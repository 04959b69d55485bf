"""Shift of a cantilever's resonance by the force on its tip, and the force from the shift."""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..cantilever.beam import MODES
from .estimate import positive, same_length
from .tapping import answers, check_cantilever

_FIRST, _LAST = 81, 81 * 3**8
"""Nodes of the quadrature, each time three times as many."""
_TOLERANCE = 1e-6
_CHUNK = 1 << 20
"""Forces asked for at once."""
_FEWEST, _MOST = 10, 5000
_NEAR = 20
"""Points within this part of the curve are near by."""
_FALLEN = 0.05
"""Part of its largest value to which a measured shift must have fallen at its far end."""


def frequency_shift(
    force: Callable[[NDArray[np.float64]], ArrayLike],
    distance: ArrayLike,
    amplitude: float,
    k: float,
    f0: float,
) -> NDArray[np.float64]:
    """Shift of the resonance of a tip that swings with constant amplitude in a force.

    The integral of Giessibl (1997), doi:10.1103/PhysRevB.56.16010, by Chebyshev-Gauss quadrature, with so many nodes
    that the last three quarters of them change less than 1e-6 of it. It is of first order in shift / f0: the true one
    is less by half of this ratio of itself. The motion is a cosine (Q of some ten or more, in one mode), the force one
    function of the distance; of one with hysteresis the mean of both ways makes the shift. From a cantilever driven at
    a fixed frequency the same shift is - f0 virial / (k amplitude^2), with `tapping_energy`.

    Parameters
    ----------
    force : callable
        Array of distances [m] to force on the tip [N] there, positive upwards; finite at all distances in the swing.
    distance : array_like [m]
        Of the tip from the sample where it is nearest in its swing, which goes on to distance + 2 amplitude.
    amplitude : float [m]
        Of the tip.
    k : float [N/m]
        Stiffness of the mode; of the first one of a rectangular cantilever 1.030 of the spring constant.
    f0 : float [Hz]
        Without the force.

    Returns
    -------
    ndarray [Hz]
        In the shape of `distance`.

    Raises
    ------
    ValueError
        If amplitude, k or f0 is not a positive number, the force is not finite somewhere in a swing, or the
        integral does not settle.
    """
    positive(amplitude=amplitude, k=k, f0=f0)
    nearest = np.asarray(distance, np.float64)
    found = _mean(force, nearest.ravel(), amplitude, _TOLERANCE)
    return (-f0 / (k * amplitude) * found).reshape(nearest.shape)


def _mean(
    force: Callable[[NDArray[np.float64]], ArrayLike], nearest: NDArray[np.float64], amplitude: float, tolerance: float
) -> NDArray[np.float64]:
    """Mean of force times cosine over a cycle [N], each distance for itself with as many nodes as it needs."""
    found, left, n = np.full(nearest.size, np.inf), np.arange(nearest.size), _FIRST
    while left.size:
        if n > _LAST:
            raise ValueError(
                f"the integral over the swing does not settle at distance = {nearest[left[0]]:g} m: the force must be "
                "one function of the distance"
            )
        u = np.cos(np.pi * (np.arange(n) + 0.5) / n)
        new, size, rows = np.empty(left.size), np.empty(left.size), max(1, _CHUNK // n)
        for first in range(0, left.size, rows):
            at = nearest[left[first : first + rows], None] + amplitude * (1.0 + u)
            each = np.broadcast_to(np.asarray(force(at), np.float64), at.shape)
            if not np.isfinite(each).all():
                where = at[~np.isfinite(each)][0]
                raise ValueError(f"the force is not finite at a distance of {where:g} m, which the tip reaches")
            new[first : first + rows] = (each @ u) / n
            size[first : first + rows] = (np.abs(each) @ np.abs(u)) / n
        settled = np.abs(new - found[left]) <= np.maximum(tolerance * np.abs(new), 1e-13 * size)
        found[left] = new
        left, n = left[~settled], 3 * n
    return found


def energy_from_drive(
    ratio: ArrayLike,
    shift: ArrayLike,
    amplitude: float,
    *,
    f0: float,
    Q: float,
    k: float,
    drive: Literal["base", "tip"] = "base",
    modes: int = MODES,
) -> NDArray[np.float64]:
    """Energy that the contact takes in a cycle, from the drive that keeps amplitude and resonance of a cantilever.

    docs/dynamic.md (51), (52), of which (53) is the first order in shift / f0. All modes of a rectangular cantilever
    are in it. Energy that goes into the air by harmonics of the motion is counted as taken by the contact.

    Parameters
    ----------
    ratio : array_like
        Amplitude of the drive over that far from the sample.
    shift : array_like [Hz]
        Frequency less that far from the sample.
    amplitude : float [m]
        As the photodiode shows it, by the sensitivity of a static force at the tip; it is kept constant, at a phase
        that lags the drive by pi / 2.
    f0, Q, k : float [Hz], [], [N/m]
        First resonance, quality factor of each mode, spring constant.
    drive : "base" or "tip"
        What is driven, as `onboard.drive`.
    modes : int
        As for `beam_energy`.

    Returns
    -------
    ndarray [J]

    Raises
    ------
    ValueError
        If amplitude, f0, Q or k is not a positive number, modes is not 1, 2 or 3, or the drive is another one.
    """
    positive(amplitude=amplitude, f0=f0, Q=Q, k=k)
    check_cantilever(drive, modes)
    b, moved = np.asarray(ratio, np.float64), np.asarray(shift, np.float64)
    tip, seen, by_base, seen_by_base = answers(1.0 + moved / f0, Q, modes)
    _, free_tip, _, free_base = answers(1.0, Q, modes)
    driven, shown, free = (by_base, seen_by_base, free_base) if drive == "base" else (tip, seen, free_tip)
    # Motion by the drive alone, as shown, at this frequency; what is missing to the motion there is the force's.
    per = b * amplitude / np.abs(free)
    force = k / seen * (-1j * amplitude - per * shown)
    energy = np.pi * np.imag(np.conj(force) * (per * driven + tip / k * force))
    return np.asarray(energy, np.float64)


class ShiftForce(NamedTuple):
    """Force on the tip where it is nearest in its swing, in the order of the curve that it was found from."""

    force: NDArray[np.float64]  # [N], positive upwards
    uncertainty: NDArray[np.float64]  # [N]
    reproduced: NDArray[np.float64]  # shift that this force makes [Hz]: where it is another, do not trust the force


def force_from_shift(
    distance: ArrayLike,
    shift: ArrayLike,
    amplitude: float,
    k: float,
    f0: float,
    *,
    noise: ArrayLike = 0.0,
) -> ShiftForce:
    """Force from a measured curve of the frequency shift over distance, at constant amplitude.

    The formula of Sader and Jarvis (2004), doi:10.1063/1.1667267, with the curve and its slope linear between the
    points, and its singular weights integrated without error. It is an approximation: for a force that decays over
    about the amplitude it errs by some percent, otherwise by less (docs/dynamic.md has figures). The uncertainty is
    that by noise, and the force that belongs to the difference between the shift given and that reproduced.

    Not in it: what lies beyond the last distance, where the shift is taken to be 0 (all forces lack about that of the
    last point), and what no shift can show. A part of the force that swings with the distance, with a wave number q at
    which the Bessel function J_1(q amplitude) is 0, makes no shift at all; forces that bend the other way within about
    the amplitude have such parts (Sader, Hughes, Huber, Giessibl 2018, doi:10.1038/s41565-018-0277-x). Then compare
    with another amplitude.

    Parameters
    ----------
    distance : array_like (n,) [m]
        Of the tip where it is nearest, rising or falling, in steps of any size; they must resolve the force's decay.
    shift : array_like (n,) [Hz]
        To first order it is proportional to the force; see `frequency_shift`.
    amplitude : float [m]
        Of the tip.
    k, f0 : float [N/m], [Hz]
        As for `frequency_shift`.
    noise : array_like [Hz]
        Standard uncertainty of the shift, one or one for each point, independent of each other.

    Raises
    ------
    ValueError
        If amplitude, k or f0 is not a positive number; if there are fewer than 10 or more than 5000 points, two at one
        distance or some that are not finite; if the shift at the far end is more than 5 % of the largest.
    """
    from scipy.ndimage import maximum_filter1d  # here: a recorder needs none
    from scipy.sparse import csr_array

    positive(amplitude=amplitude, k=k, f0=f0)
    z, given = same_length(distance=distance, shift=shift)
    if not _FEWEST <= z.size <= _MOST:
        raise ValueError(f"a curve of {z.size} points is not allowed: it must have {_FEWEST} to {_MOST}; take means")
    deviation = np.broadcast_to(np.asarray(noise, np.float64), z.shape)
    if not (np.isfinite(z) & np.isfinite(given) & np.isfinite(deviation)).all() or (deviation < 0.0).any():
        raise ValueError("distance, shift and noise must be finite numbers, noise not negative")
    order = np.argsort(z)
    z, given, deviation = z[order], given[order], deviation[order]
    if (np.diff(z) == 0.0).any():
        raise ValueError(f"two points at distance = {z[:-1][np.diff(z) == 0.0][0]:g} m: take their mean")
    end, most = abs(float(given[-max(3, z.size // 20) :].mean())), float(np.abs(given).max())
    if end > _FALLEN * most:
        raise ValueError(
            f"the shift at the far end is {end:.3g} Hz, {end / most:.1%} of the largest: it must have fallen to "
            f"{_FALLEN:.0%}; measure to larger distances, or subtract the part of long range"
        )
    plain, root = _weights(z)
    slope = csr_array(np.gradient(np.eye(z.size), z, axis=0, edge_order=2))
    force_per = plain + np.sqrt(amplitude / np.pi) / 8.0 * root - amplitude * np.sqrt(0.5 * amplitude) * (root @ slope)
    force_per *= 2.0 * k / f0
    force = force_per @ given
    # Beyond the last point there is none. As exact as this must be, a hundredth of what it is compared with.
    found = _mean(lambda at: np.interp(at, z, force, right=0.0), z, amplitude, 1e-4)
    reproduced = -f0 / (k * amplitude) * found
    # The difference changes its sign here and there: the largest one near by counts.
    missed = maximum_filter1d(np.abs(force_per @ (given - reproduced)), 2 * (z.size // _NEAR) + 3)
    uncertainty = np.sqrt(np.square(force_per) @ np.square(deviation) + np.square(missed))
    back = np.empty_like(order)
    back[order] = np.arange(order.size)
    return ShiftForce(force[back], uncertainty[back], reproduced[back])


def _weights(z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n, n) weights of the values of a function that is linear between the points, so that row i gives its integral
    from z_i on, and that of it over sqrt(z - z_i).
    """
    plain, root = np.zeros((2, z.size, z.size))
    for i in range(z.size - 1):
        x = z[i:] - z[i]
        a, b, width = x[:-1], x[1:], np.diff(x)
        zeroth, first = 2.0 * (np.sqrt(b) - np.sqrt(a)), 2.0 / 3.0 * (b * np.sqrt(b) - a * np.sqrt(a))
        plain[i, i:-1] += 0.5 * width
        plain[i, i + 1 :] += 0.5 * width
        root[i, i:-1] += (b * zeroth - first) / width
        root[i, i + 1 :] += (first - a * zeroth) / width
    return plain, root
