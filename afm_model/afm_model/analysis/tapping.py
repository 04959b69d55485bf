"""Energy that a tapping tip leaves in the sample, and the virial, from amplitude and phase."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .estimate import positive


class TappingEnergy(NamedTuple):
    """Per cycle, by the motion at the frequency of the drive."""

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
    doi:10.1103/PhysRevB.64.193411. What higher harmonics and other modes carry is left out.

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
