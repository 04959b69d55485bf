"""What noise leaves with positions alone, whoever computes the drive; docs/predictive.md.

python tools/law_noise.py            # print the tables
python tools/law_noise.py --write    # and put them into docs/predictive.md

Noise: a scanner that slips along x = y obeys one linear model: position, speed, friction, height of the sample, and how
these two go on. How well it is known is told by the Riccati equation. A drive that answers a measurement acts a delay
later and is held: the error at the end of its period is at least the uncertainty of the prediction to there. The bend
of the surface is the largest that the law assumes; half of it leaves next to as much.

Surface and noise: the same of a surface that has no shorter waves than a known one, which is told, has been seen before
or lies ahead of the tip; its height determines friction. In packets only this one holds.
"""

import math
import sys
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

sys.path.insert(0, str(Path(__file__).parent))
from law_bounds import AMPLITUDE, RATES, SPEED, constants, pushing
from law_pages import show, table

_PARTS = 8
"""Of a control period, in which the slope of friction counts as constant."""
_LONGEST = 3e-4
"""Period up to which places lie so close that the bend of the surface tells how it goes on [s]."""


def uncertainties(period: float, delay: int, strength: float = 1.0, wander: bool = False) -> tuple[float, float, float]:
    """Deviations of an axis in percent of the amplitude: of the estimate, and of the position a delay and a hold later.

    Where friction falls on the way of the tip an error grows: a spring that pushes away, by the slope of friction.

    Parameters
    ----------
    period : float [s]
    delay : int
        Control periods.
    strength : float
        Friction over the nominal one.
    wander : bool
        Gain of friction and slow force are not known at first, and change by the random walks that the law assumes. On
        a straight way they are one force.

    Returns
    -------
    (estimate, later, at_most) : floats
        Rms over all places of a wave of both, and the second one at the worst place.
    """
    p = constants(period, delay, feedback="measured")
    h, q = p["hold"], 2.0 * p["wave_number"] / math.sqrt(2.0)
    rate = q * SPEED
    of_wave = max(16, round(2.0 * math.pi / (rate * h)))
    stiffness, damping = p["stiffness"][:2].mean(), p["damping"][:2].mean()
    half, of_ripple, pushes = 0.5 * p["height"], strength * p["f_0"] * p["ripple"], pushing(p, strength)

    def transition_at(phase: float) -> NDArray[np.float64]:
        """Of position, speed, friction, its rate, height, its slope, another force, through a period from there."""
        Phi: NDArray[np.float64] = np.eye(7)
        for i in range(_PARTS):
            cos = math.cos(phase + rate * h * (i + 0.5) / _PARTS)
            A = np.zeros((7, 7))
            A[0, 1] = A[2, 3] = 1.0
            A[1, :3] = -stiffness - pushes * cos, -damping, -1.0
            A[1, 6] = -1.0
            # The height that is measured changes by the way that the tip has really gone.
            A[4, 1], A[4, 5] = half * q * cos, SPEED
            Phi = expm(A * h / _PARTS) @ Phi
        return Phi

    # The slopes of friction and height change from period to period by those of the steepest bend of the surface.
    of_friction = np.array([0.0, 0.0, 0.5 * h * h, h, 0.0, 0.0, 0.0]) * of_ripple * rate * rate
    of_height = np.array([0.0, 0.0, 0.0, 0.0, 0.5 * SPEED * h, 1.0, 0.0]) * half * q * q * SPEED * h
    of_numbers = wander * np.square([strength * p["f_0"], 1.0])
    Q = np.outer(of_friction, of_friction) + np.outer(of_height, of_height) + 1e-12 * np.eye(7)
    Q[6, 6] = of_numbers @ p["walk"][0][:2]
    # Friction along x is 1 / sqrt(2) of its bound.
    noise = {0: p["position_noise"] ** 2, 2: 2.0 * p["force_noise"] ** 2, 4: p["height_noise"] ** 2 + p["z_noise"] ** 2}
    another = of_numbers @ np.square(p["first"][0][:2])
    P, estimate, later = np.diag([*2 * (p["position_noise"] ** 2,), *4 * (0.1,), another]), [], []
    steps = [transition_at(rate * h * k) for k in range(4 * of_wave + delay + 1)]
    for k in range(4 * of_wave):
        P = steps[k] @ P @ steps[k].T + Q
        for i, variance in noise.items():
            P = P - np.outer(P[:, i], P[i]) / (P[i, i] + variance)
        if k >= 3 * of_wave:
            estimate.append(P[0, 0])
            ahead = P
            for Phi in steps[k + 1 : k + 2 + delay]:
                ahead = Phi @ ahead @ Phi.T + Q
            later.append(ahead[0, 0])
    percent = 100.0 / (AMPLITUDE * math.sqrt(2.0))
    return percent * math.sqrt(np.mean(estimate)), percent * math.sqrt(np.mean(later)), percent * math.sqrt(max(later))


KNOWS = ("known", "learned", "observed")


def with_noise(period: float, delay: int, strength: float, knows: str, wander: bool = False) -> float:
    """Three deviations of an axis at the worst place, at the end of a drive, of a surface without shorter waves [%].

    The height is a Gaussian process with all wave numbers up to `law.wave_number` alike, as large as that of a wave of
    `law.height`, and determines friction by load and curvature. Scanner and surface follow one linear model about the
    reference, and positions, forces and heights with the noise that the law is told are all that is measured.

    Parameters
    ----------
    period : float [s]
    delay : int
        Control periods.
    strength : float
        Friction over the nominal one.
    knows : str
        "known": the surface is told, second period of the sine; "learned": it is not, third period; "observed": the
        tip goes on along a line where it has not been, at the largest speed of the sine, fourth wave.
    wander : bool
        Gain of friction, slow force and stiffness are not known at first, and change by the random walks that the law
        assumes.
    """
    p = constants(period, delay, feedback="measured", packet=20)
    h, steps = p["hold"], max(4, math.ceil(p["hold"] / 0.1))
    q, omega, size = 2.0 * p["wave_number"] / math.sqrt(2.0), SPEED / (AMPLITUDE * math.sqrt(2.0)), p["height"]
    stiffness, damping, f = p["stiffness"][:2].mean(), p["damping"][:2].mean(), strength * p["f_0"]
    by_load, by_curvature = p["eta_c2"] * p["f_load"], p["ripple"] / size
    pushes = pushing(p, strength)
    of_waves = np.zeros(0) if knows == "known" else (np.arange(16) + 0.5) / 16

    def state_at(t: float) -> tuple[float, float]:
        """Sense of the motion, phase of the wave."""
        if knows == "observed":
            return 1.0, q * SPEED * t
        return math.copysign(1.0, math.cos(omega * t)), q * SPEED / omega * math.sin(omega * t)

    def waves(phase: float, of_height: float, of_curvature: float) -> NDArray[np.float64]:
        sizes = of_height - of_curvature * np.square(of_waves)
        return np.concatenate([np.cos(phase * of_waves) * sizes, np.sin(phase * of_waves) * sizes])

    count = 2 + 2 * of_waves.size
    numbers = 3 if wander else 0

    def transition_from(t: float) -> NDArray[np.float64]:
        """Of error, its rate, the sizes of the waves, and the numbers of the scanner, through a period."""
        Phi, step = np.eye(count + numbers), h / steps
        for i in range(steps):
            sense, phase = state_at(t + (i + 0.5) * step)
            Phi[0] += 0.5 * step * Phi[1]
            rate = -(stiffness + sense * pushes * math.cos(phase)) * Phi[0] - damping * Phi[1]
            rate[2:count] -= sense * f * waves(phase, by_load, by_curvature)
            rate[count:] -= np.array([sense * f, 1.0, phase / q])[:numbers]
            Phi[1] += step * rate
            Phi[0] += 0.5 * step * Phi[1]
        return Phi

    period_of = 2.0 * math.pi / (q * SPEED if knows == "observed" else omega)
    last = {"known": 2, "learned": 3, "observed": 4}[knows]
    P = np.diag(
        [
            *(p["position_noise"] ** 2, 0.01),
            *(size**2 / (8.0 * of_waves.size) for _ in range(count - 2)),
            *np.square(p["first"][0][:numbers]),
        ]
    )
    walks = np.diag(np.concatenate([np.zeros(count), p["walk"][0][:numbers]]))
    noise = (p["position_noise"] ** 2, p["height_noise"] ** 2 + p["z_noise"] ** 2, 2.0 * p["force_noise"] ** 2)
    ahead, largest = [transition_from(h * j) for j in range(delay + 2)], 0.0
    for k in range(round(last * period_of / h)):
        P = ahead[0] @ P @ ahead[0].T + walks
        P = 0.5 * (P + P.T)
        phase = state_at(h * (k + 1))[1]
        steep = math.cos(phase)
        # Position, height, friction: what each has of the error, and of the waves.
        of_error = (1.0, 0.5 * size * q * steep, pushes * steep)
        seen = (waves(phase, 0.0, 0.0), waves(phase, 1.0, 0.0), f * waves(phase, by_load, by_curvature))
        for e, surface, variance in zip(of_error, seen, noise, strict=True):
            row = np.concatenate([[e, 0.0], surface, np.zeros(numbers)])
            gain = P @ row
            P = P - np.outer(gain, gain) / (row @ gain + variance)
        ahead = [*ahead[1:], transition_from(h * (k + delay + 2))]
        if h * (k + 1) > (last - 1) * period_of:
            row = ahead[delay][0]
            for Phi in reversed(ahead[:delay]):
                row = row @ Phi
            largest = max(largest, float(row @ P @ row))
    return 300.0 * math.sqrt(largest) / (AMPLITUDE * math.sqrt(2.0))


@cache
def bound_of_noise(period: float, delay: int, strength: float, knows: str, packets: bool) -> float:
    """Largest error that noise leaves with positions alone, three deviations at the worst place [%].

    The numbers of the scanner have to be found: no law is told that it was told the truth. Of a surface ahead that is
    not known single drives assume no more than its largest bend.
    """
    if knows == "observed" and not packets:
        return 3.0 * uncertainties(period, delay, strength, True)[2]
    return with_noise(period, delay, strength, knows, True)


def tables(rates: tuple[tuple[str, float], ...] = RATES) -> dict[str, str]:
    """Each table by its mark in the page, with the rows of these rates."""
    noise, known, wander = [], [], []
    for name, period in rates:
        if period <= _LONGEST:
            of_each = [uncertainties(period, 1, strength) for strength in (1.0, 1.5, 2.0)]
            now, later, _ = of_each[0]
            noise.append([f"{name} + 1", f"{now:.2f}", f"{later:.2f}", *(f"{3.0 * each[2]:.2g}" for each in of_each)])
        left = [
            "; ".join(f"{with_noise(period, 1, strength, knows):.2g}" for strength in strengths)
            for knows, strengths in zip(KNOWS, ((1.5, 2.0), (1.0, 1.5, 2.0), (1.0, 1.5, 2.0)), strict=True)
        ]
        known.append([f"{name} + 1", *left])
        left = [
            "; ".join(f"{bound_of_noise(period, 1, f, knows, period > _LONGEST):.2g}" for f in (1.0, 1.5, 2.0))
            for knows in KNOWS
        ]
        wander.append([f"{name} + 1", *left])
    rate, worst = "period + delay", "3 deviations at the worst place [%]"
    head = [rate, "estimate, rms [%]", "at the end of the drive, rms [%]", worst, "of friction x 1.5 [%]", "x 2 [%]"]
    told = ["surface known, friction x 1.5; x 2 [%]", "line learned, the truth; x 1.5; x 2 [%]"]
    each = ["surface known [%]", "line learned [%]", "a line not seen before [%]"]
    return {
        "bound noise": table(head, noise),
        "bound known": table([rate, *told, "a line not seen before [%]"], known),
        "bound wander": table([rate, *each], wander),
    }


def main() -> int:
    """Print the tables; `--write`: into the page as well."""
    show(tables().items(), "--write" in sys.argv[1:])
    return 0


if __name__ == "__main__":
    sys.exit(main())
