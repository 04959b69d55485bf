"""A cantilever in finite elements: 60 Hermite beam elements, springs at its end. Knows nothing of modes."""

import numpy as np
from scipy.linalg import eigh, solve

ELEMENTS = 60


class ElementBeam:
    """Uniform cantilever of spring constant k [N/m], length L [m], whose first free resonance is f0 [Hz].

    The last two coordinates are deflection [m] and slope [1] of the end.
    """

    def __init__(self, k: float, L: float, f0: float) -> None:
        self._length = L
        l = L / ELEMENTS  # noqa: E741
        EI = k * L**3 / 3.0
        bend = EI / l**3 * np.array(
            [[12, 6 * l, -12, 6 * l], [6 * l, 4 * l * l, -6 * l, 2 * l * l], [-12, -6 * l, 12, -6 * l],
             [6 * l, 2 * l * l, -6 * l, 4 * l * l]]
        )  # fmt: skip
        mass = l / 420.0 * np.array(
            [[156, 22 * l, 54, -13 * l], [22 * l, 4 * l * l, 13 * l, -3 * l * l], [54, 13 * l, 156, -22 * l],
             [-13 * l, -3 * l * l, -22 * l, 4 * l * l]]
        )  # fmt: skip
        size = 2 * (ELEMENTS + 1)
        K, M = np.zeros((size, size)), np.zeros((size, size))
        for e in range(ELEMENTS):
            here = slice(2 * e, 2 * e + 4)
            K[here, here] += bend
            M[here, here] += mass
        self.K, self.M = K[2:, 2:], M[2:, 2:]  # clamped
        # The mass per length that gives f0.
        self.M *= (self.frequencies()[0] / f0) ** 2

    def frequencies(self, end_spring: np.ndarray | None = None) -> np.ndarray:
        """Resonances [Hz] with springs (2, 2) between deflection and slope of the end."""
        K = self.K.copy()
        if end_spring is not None:
            K[-2:, -2:] += end_spring
        return np.sqrt(eigh(K, self.M, eigvals_only=True)) / (2.0 * np.pi)

    def compliance(self) -> np.ndarray:
        """(2, 2) deflection and slope of the end per force and couple there."""
        loads = np.zeros((len(self.K), 2))
        loads[-2, 0] = loads[-1, 1] = 1.0
        # Slopes counted per length: metres and radians are far apart.
        scale = np.tile([1.0, 1.0 / self._length], len(self.K) // 2)
        return (scale[:, None] * solve(scale[:, None] * self.K * scale, scale[:, None] * loads))[-2:]
