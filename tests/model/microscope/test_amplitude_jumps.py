"""Claims about the branches of attraction and repulsion: where one ends, the amplitude jumps to the other, and it
does so at the distance at which periodic motions, integrated from event to event, meet and vanish.
"""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq, fsolve, minimize_scalar

from afm_model.microscope import AmplitudeCurve, Local
from afm_model.microscope.results import Outcome

from ..clamped_mode import clamped_mode
from .test_tune import driven

# Lengths in nm, forces in nN.
F0, K, Q, INERTIA, R, MODULUS = 77e3, 2.8, 100.0, 1.5660, 10.0, 4.5
SOFTLY, STRONGLY = (12.0, 0.030, 0.03), (16.0, 0.040, 0.04)
"""Free amplitude of the end, Hamaker constant [nN nm], work of adhesion [nN/nm]."""
RATE = 2e-8
"""[m/s]; behind the end of a branch a jump comes late, by 0.04 nm at this rate and by 0.2 nm at 16 times of it."""


class Force:
    """Of a sphere: van der Waals, shifted so that at contact it is -2 pi w R, and Hertz."""

    def __init__(self, hamaker: float, work: float):
        self.reach, self.pull = hamaker * R / 6.0, -2.0 * math.pi * work * R
        self.beyond = math.sqrt(-self.reach / self.pull)

    def __call__(self, d: float, touches: bool) -> float:
        if touches:
            return MODULUS * math.sqrt(R) * max(-d, 0.0) ** 1.5 + self.pull
        return -self.reach / (max(d, 0.0) + self.beyond) ** 2

    def slope(self, d: float, touches: bool) -> float:
        if touches:
            return -1.5 * MODULUS * math.sqrt(R * max(-d, 0.0))
        return 2.0 * self.reach / (max(d, 0.0) + self.beyond) ** 3


class Beam:
    """Modes of a driven beam above a sample, as differential equations over the phase of the drive."""

    def __init__(self, modes: int, free: float, force: Force):
        each = [clamped_mode(number) for number in range(modes)]
        self.modes, self.force, self.base = modes, force, free / INERTIA / Q
        self.k = np.array([K * m.stiffness for m in each])
        self.w = np.array([m.over_first for m in each])
        self.by_base = np.array([m.mean * m.end / m.mean_square for m in each])
        self.rest = 1.0 / K - float(np.sum(1.0 / self.k))  # modes beyond: a static compliance

    def tip(self, unloaded: float, touches: bool) -> float:
        """Its distance from the sample, where it would be at `unloaded` but for the modes beyond."""
        d = unloaded
        for _ in range(40):
            step = (d - unloaded - self.rest * self.force(d, touches)) / (
                1.0 - self.rest * self.force.slope(d, touches)
            )
            d -= step
            if abs(step) < 1e-12:
                break
        return d

    def after_a_period(self, y: np.ndarray, phase: float, distance: float, touches: bool) -> np.ndarray:
        n = self.modes

        def rates(t: float, y: np.ndarray) -> np.ndarray:
            b = self.base * math.cos(t)
            F = self.force(self.tip(distance + b + y[:n].sum(), touches), touches)
            return np.concatenate([y[n:], self.w**2 * (F / self.k - y[:n]) - self.w / Q * y[n:] + self.by_base * b])

        def contact(t: float, y: np.ndarray) -> float:
            return distance + self.base * math.cos(t) + float(y[:n].sum()) + self.rest * self.force.pull

        contact.terminal = True
        t, end = phase, phase + 2.0 * math.pi
        while t < end:
            contact.direction = 1.0 if touches else -1.0
            ends = {"events": contact, "rtol": 1e-8, "atol": 1e-9, "max_step": 0.5}
            found = solve_ivp(rates, (t, end), y, method="DOP853", **ends)
            y, t = found.y[:, -1], found.t[-1]
            touches ^= found.status == 1
        return y

    def distance(self, lowest: float, phase: float, distance: float) -> float:
        """Of the undeflected tip whose periodic motion has this lowest point; begun from an approximate phase there,
        and an approximate distance.
        """
        touches, n = lowest < 0.0, self.modes

        def off(x: np.ndarray) -> np.ndarray:
            y = np.zeros(2 * n)
            y[1:n], y[n + 1 :] = x[2 : n + 1], x[n + 1 :]
            given = lowest - x[1] - self.base * math.cos(x[0]) - self.rest * self.force(lowest, touches)
            y[0], y[n] = given - y[1:n].sum(), self.base * math.sin(x[0]) - y[n + 1 :].sum()
            return self.after_a_period(y, x[0], x[1], touches) - y

        x = fsolve(off, [phase, distance] + [0.0] * (2 * n - 2), xtol=1e-7, epsfcn=1e-10)
        assert np.abs(off(x)).max() < 1e-5
        return float(x[1])


def balanced(lowest: float, free: float, force: Force) -> tuple[float, float]:
    """Phase and distance of a motion with this lowest point, of its first harmonic alone: scipy's quadrature."""

    def answer(A: float) -> complex:
        """The motion of the tip, whose size is A where it is right."""
        touching = math.acos(min(max(1.0 - max(-lowest, 0.0) / A, -1.0), 1.0))

        def pushed(x: float) -> float:
            d = lowest + A - A * math.cos(x)
            return -force(d, d < 0.0) * math.cos(x)

        mean = quad(pushed, 0.0, math.pi, points=[touching], limit=400, epsabs=1e-9)[0]
        stiffness, base = 2.0 / math.pi * mean / A, free / INERTIA / Q
        return (free / Q + 1j / Q * base) / (1j / Q - stiffness / (K * 1.0302))

    # The larger of two, where there are two.
    A = brentq(lambda A: abs(answer(A)) - A, 0.65 * free, 1.02 * free, xtol=1e-10)
    return -float(np.angle(answer(A))), lowest + A


def folds(free: float, force: Force) -> list[tuple[float, float, float]]:
    """Lowest points, phases and distances at which the branch of attraction and that of repulsion end."""

    def at(bounds: tuple[float, float], sign: float) -> tuple[float, float, float]:
        found = minimize_scalar(
            lambda u: sign * balanced(u, free, force)[1], bounds=bounds, method="bounded", options={"xatol": 1e-4}
        )
        return float(found.x), *balanced(float(found.x), free, force)

    return [at((-0.3, 0.05), 1.0), at((-0.55, -0.3), -1.0)]


def extreme(curve: Callable[[float], float], about: float) -> float:
    """Of a curve that is nearly a parabola."""
    near = np.array([about - 0.04, about, about + 0.04])
    a, b, c = np.polyfit(near - about, [curve(u) for u in near], 2)
    assert abs(b / (2.0 * a)) < 0.06
    return float(c - b * b / (4.0 * a))


def ends_of_branches(modes: int, free: float, hamaker: float, work: float) -> list[float]:
    force = Force(hamaker, work)
    beam = Beam(modes, free, force)
    found = []
    for lowest, phase, distance in folds(free, force):
        found.append(extreme(lambda u, p=phase, d=distance: beam.distance(u, p + math.pi, d), lowest))
    return found


def followed(microscope: Local, gap: float, curve: AmplitudeCurve) -> tuple[Outcome, np.ndarray, np.ndarray]:
    """The outcome of a curve from `gap` [m] on; distance of the undeflected tip and A exp(-i phi) [m], a row a way."""
    z0 = microscope.instrument.orders.onboard.z
    outcome = microscope.execute(curve)
    found = {name: each.values for name, each in outcome.result.variables.items()}
    return outcome, gap - (found["z"] - z0), found["amplitude"] * np.exp(-1j * found["phase"])


def jumps(free: float, hamaker: float, work: float, **values: float | str) -> np.ndarray:
    """Distances at which amplitude and phase jump, on the way there and back."""
    last, first, begin = 0.65 * free, free, 34.0
    gap = (first + begin) * 1e-9
    sample = {"plant__contact": "dmt", "plant__hamaker": hamaker * 1e-18, "plant__work_of_adhesion": work}
    lever = {"plant__lever": "ppp_fmr", "plant__Q": Q, "plant__tilt": 0.0, "plant__gap": gap, "plant__K": 4.5e9}
    drive = {"onboard__drive_amplitude": free * 1e-9 / INERTIA / Q, "onboard__time_constant": 50e-6}
    microscope = driven(**lever | sample | drive | values, plant__tau=1.0)
    ramp = (first - last) * 1e-9
    curve = AmplitudeCurve(begin=begin * 1e-9, ramp=ramp, rate=RATE, settle=5e-3, points=2000)
    outcome, apart, motion = followed(microscope, gap, curve)
    # In the jump itself the averaged plant does not hold for a moment.
    assert (outcome.status, outcome.message[:30]) in {("complete", ""), ("complete", "plant.kind = averaged did not ")}
    where = np.abs(np.diff(motion)).argmax(1)
    return np.array([0.5 * (d[i] + d[i + 1]) for d, i in zip(1e9 * apart, where, strict=True)])


AVERAGED = {
    "plant__kind": "averaged",
    "plant__dt": 2e-6,
    "onboard__regulate": "amplitude",
    "onboard__setpoint_force": 0.0,
}


def test_averaged_plant_jumps_where_the_branches_end_and_not_at_one_place():
    found = jumps(*STRONGLY, **AVERAGED)
    assert found == pytest.approx([distance for _, _, distance in folds(STRONGLY[0], Force(*STRONGLY[1:]))], abs=0.06)
    assert found[1] - found[0] > 3.0


@pytest.mark.long
@pytest.mark.parametrize(("sample", "modes"), [(SOFTLY, 1), (SOFTLY, 2), (STRONGLY, 2)])
def test_both_plants_jump_where_periodic_motions_from_event_to_event_end(sample, modes):
    expected = ends_of_branches(modes, *sample)
    found = jumps(*sample, plant__kind="lever", plant__dt=1e-7, plant__modes=modes)
    assert found == pytest.approx(expected, abs=0.06)
    # The averaged plant knows nothing of the snap to the sample that is most of a massless one with one mode.
    if modes > 1:
        assert jumps(*sample, **AVERAGED) == pytest.approx(expected, abs=0.06)
