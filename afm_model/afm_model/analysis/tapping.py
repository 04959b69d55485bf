"""Energy that a tapping tip leaves in the sample, and the virial, from amplitude and phase."""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..cantilever.beam import MODE, MODES
from .estimate import positive


class TappingEnergy(NamedTuple):
    """Per cycle, by the motion at the frequency of the drive, and with `beam_energy` at its harmonics."""

    dissipated: NDArray[np.float64]  # in the contact [J]
    virial: NDArray[np.float64]  # mean of force, positive upwards, times displacement [J]; negative: repulsive
    force: NDArray[np.complex128]  # F exp(-i phi) of the force F cos(2 pi f t - phi) on the tip at this frequency [N]


def tapping_energy(
    response: ArrayLike,
    free: ArrayLike,
    *,
    frequency: float,
    f0: float,
    Q: float,
    k: float,
    base: ArrayLike = 0.0,
) -> TappingEnergy:
    """Dissipation and virial of a cantilever that is driven alike with and without the sample.

    From the force that makes `response` of `free`. At f0 with a base at rest the first is (pi k A / Q) (A0 sin phi - A)
    of Cleveland et al. (1998), doi:10.1063/1.121434, the second that of San Paulo and Garcia (2001),
    doi:10.1103/PhysRevB.64.193411. What higher harmonics and other modes carry is left out:
    `beam_energy` has it.

    Parameters
    ----------
    response, free : array_like of complex [m]
        A exp(-i phi) of the deflection of the end in its mode, A cos(2 pi f t - phi), over the sample and far from it.
        What a photodiode shows is less, for the first mode of a rectangular cantilever 0.918 of it.
    frequency : float [Hz]
        Of the drive.
    f0 : float [Hz]
    Q : float
    k : float [N/m]
        Stiffness of the mode; of the first one of a rectangular cantilever 1.030 of the spring constant.
    base : array_like of complex [m]
        Motion of the base, by which the tip moves more than it is deflected.

    Raises
    ------
    ValueError
        If frequency, f0, Q or k is not a positive number.
    """
    positive(frequency=frequency, f0=f0, Q=Q, k=k)
    r = frequency / f0
    moved = np.asarray(response, np.complex128)
    force = k * (1.0 - r * r + 1j * r / Q) * (moved - np.asarray(free, np.complex128))
    product = np.conj(force) * (moved + np.asarray(base, np.complex128))
    return TappingEnergy(np.pi * product.imag, 0.5 * product.real, force)


def beam_energy(
    shown: ArrayLike,
    free: ArrayLike,
    *,
    frequency: float,
    f0: float,
    Q: float,
    k: float,
    drive: Literal["base", "tip"] = "base",
    modes: int = MODES,
    harmonics: Mapping[int, ArrayLike] | None = None,
) -> TappingEnergy:
    """Dissipation and virial of a rectangular cantilever, from what a photodiode shows of it: all its modes.

    docs/dynamic.md (51), (52). A force on the tip shows and moves the tip as its modes and its static rest make it, at
    the frequency of the drive and at each harmonic. What the tip takes from the drive at the frequency of the drive
    goes into the contact, or by harmonics into the air. Harmonics near the resonance of a higher mode (the sixth, the
    seventh) take most of that. The motion has the period of the drive; the cantilever is upright; friction along it
    bends it as well and is taken for a force across it.

    Parameters
    ----------
    shown, free : array_like of complex [m]
        A exp(-i phi) of the deflection that is shown, A cos(2 pi f t - phi), over the sample and far from it, by a
        sensitivity that is that of a static force at the tip.
    frequency : float [Hz]
        Of the drive.
    f0 : float [Hz]
        First resonance.
    Q : float
        Of each mode.
    k : float [N/m]
        Spring constant.
    drive : "base" or "tip"
        What is driven, as `onboard.drive`.
    modes : int
        How many oscillate; those beyond follow without delay. `plant.modes`; of a measured cantilever 3.
    harmonics : mapping of int to array_like [m]
        Amplitude shown, at 2, 3, ... times the frequency. What is not given is left out of both results.

    Raises
    ------
    ValueError
        If frequency, f0, Q or k is not a positive number, modes is not 1, 2 or 3, the drive is another one, or a
        harmonic is below 2.
    """
    positive(frequency=frequency, f0=f0, Q=Q, k=k)
    check_cantilever(drive, modes)
    moved, seen, by_base, seen_by_base = answers(frequency / f0, Q, modes)
    off = np.asarray(free, np.complex128)
    force = k / seen * (np.asarray(shown, np.complex128) - off)
    tip = off * (by_base / seen_by_base if drive == "base" else moved / seen) + moved / k * force
    product = np.conj(force) * tip
    dissipated, virial = np.pi * product.imag, 0.5 * product.real
    for n, amplitude in (harmonics or {}).items():
        if n < 2:
            raise ValueError(f"harmonic {n} is not allowed: it must be >= 2")
        moved, seen, _, _ = answers(n * frequency / f0, Q, modes)
        square = np.abs(np.asarray(amplitude, np.complex128) * k / seen) ** 2
        dissipated = dissipated + n * np.pi * square * moved.imag / k
        virial = virial + 0.5 * square * moved.real / k
    return TappingEnergy(dissipated, virial, force)


def check_cantilever(drive: str, modes: int) -> None:
    """Raise ValueError for a number of modes or a drive that `beam_energy` does not have."""
    if modes not in range(1, MODES + 1):
        raise ValueError(f"modes = {modes} is not allowed: it must be one of 1 to {MODES}")
    if drive not in ("base", "tip"):
        raise ValueError(f"drive = {drive} is not allowed: it must be base or tip")


def answers(r: Any, Q: float, modes: int) -> tuple[Any, Any, Any, Any]:
    """Of a cantilever of spring constant 1 at r times its first resonance: way of the tip and deflection shown under a
    force on the tip, and by a base that moves by 1; way of the base included.
    """
    moved, seen, by_base, seen_by_base = complex(1.0), complex(1.0), complex(1.0), complex(0.0)
    for mode in MODE[:modes]:
        ratio = r / mode.frequency
        answer = 1.0 / (1.0 - ratio * ratio + 1j * ratio / Q)
        moved += mode.compliance * (answer - 1.0)
        seen += 2.0 / 3.0 * mode.slope * mode.compliance * (answer - 1.0)
        by_base += mode.base * ratio * ratio * answer
        seen_by_base += 2.0 / 3.0 * mode.slope * mode.base * ratio * ratio * answer
    return moved, seen, by_base, seen_by_base
