"""Claims about the root that the plant `lever` takes for the indentation: the first one the tip is pulled to."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from afm_model.contact.maugis import branch
from afm_model.plant.lever.indent import indent

from .lever_bench import LeverBench


class Forces:
    """Normal force over the indentation, by the exact equations and -H R / (6 D^2), in units of the contact."""

    def __init__(self, b: LeverBench) -> None:
        plant = b.plant
        units = plant.contact_units
        self.units = units
        self._exact = branch(plant.contact, plant.transition)
        self.end = self._exact.least_indentation
        self.least = float(self._exact.solve(np.array([self.end]))[1][0])
        hamaker = plant.pair_numbers.hamaker * plant.cantilever_numbers.tip_radius
        self._attraction = hamaker / (6.0 * units.force * units.indentation**2)
        self._reach = self.end + float(np.sqrt(-self._attraction / self.least))
        self._places = self.end + np.linspace(0.0, 21.0, 20_001) ** 2
        self._forces = self._exact.solve(self._places)[1]

    def __call__(self, d: Any) -> np.ndarray:
        d = np.atleast_1d(d)
        # To look for a change of the sign the equations are solved beforehand, at many places.
        inside = np.interp(d, self._places, self._forces)
        if d.size == 1:
            inside = self._exact.solve(np.maximum(d, self.end))[1]
        outside = -self._attraction / (self._reach - np.minimum(d, self.end)) ** 2
        return np.where(d > self.end, inside, outside)

    def first(self, begin: float, target: float, w: float) -> float:
        """The first zero of target - d - w N(d) from `begin` on, to the side to which it pulls."""

        def balance(d: Any) -> Any:
            return target - d - w * self(d)

        pull = float(np.sign(balance(begin)[0]))
        d = begin + pull * np.concatenate([np.linspace(0.0, 2.0, 20_001), np.geomspace(2.0, 400.0, 2000)[1:]])
        crossed = int(np.argmax(balance(d) * pull <= 0.0))
        assert crossed > 0
        return float(brentq(lambda x: balance(x)[0], d[crossed - 1], d[crossed], xtol=1e-8))


@pytest.mark.parametrize(
    "contact", [{"plant__contact": "jkr"}, {"plant__contact": "dmt"}, {}, {"plant__K": 5e9, "plant__range": 0.3e-9}]
)
def test_the_indentation_is_the_first_root_in_the_direction_in_which_the_tip_is_pulled(contact):
    b = LeverBench(**contact, plant__gap=1e-9)
    forces = Forces(b)
    unit, newton = forces.units.indentation, forces.units.force
    at, draw = b._layout.places["plant_map"], np.random.default_rng(7)
    sides = {"in": 0, "out": 0, "into": 0, "out of": 0}
    for case in range(160):
        # Compliances of stiff and soft levers: with the last there are folds.
        w = float(10.0 ** draw.uniform(-2.5, 0.7))
        begin = forces.end + float(draw.choice([-8.0, -1.0, -0.1, 0.1, 1.0, 8.0]) * draw.uniform(0.2, 1.0))
        target = begin + w * float(forces(begin)[0]) + float(draw.uniform(-1.0, 1.0) * 10.0 ** (case % 3 - 1))
        expected = forces.first(begin, target, w)
        N = float(forces(begin)[0])
        b.s.N, b.s.F_max = N * newton, 0.0
        # From where it was, or from a place that was guessed.
        start = begin if case % 2 else begin + float(draw.uniform(-1.0, 1.0))
        x, found, *_ = indent(begin * unit, start * unit, target * unit, w * unit / newton, 0.0, b.s, b.p, b.block, at)
        # Near a fold a small error of the table moves the root by its square root.
        slope = 1.0 + w * float((forces(expected + 1e-5) - forces(expected - 1e-5))[0]) / 2e-5
        if abs(slope) < 0.05 or abs(expected - forces.end) < 1e-3:
            continue
        assert x / unit == pytest.approx(expected, abs=1e-3 / min(slope, 1.0)), (case, w, begin, target)
        assert x + w * unit / newton * found == pytest.approx(target * unit, abs=1e-9 * unit)
        was, is_in = begin > forces.end, expected > forces.end
        sides[("in" if was else "into") if is_in else ("out of" if was else "out")] += 1
    assert min(sides.values()) > 5, sides
