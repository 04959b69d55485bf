"""Claims about the sample `lattice`: its potential and its height."""

import math

import numpy as np
import pytest

from .test_samples import Place

A, E = 0.3e-9, 0.8e-19
KIND = {"sample.kind": "lattice", "sample.constant": A}


@pytest.mark.parametrize("lattice", ["line", "square", "hexagonal"])
@pytest.mark.parametrize("angle", [0.0, 0.7, -2.0])
def test_second_derivatives_of_the_potential_are_those_of_its_slopes(lattice, angle, rng):
    place = Place(
        KIND | {"sample.lattice": lattice, "sample.angle": angle, "sample.barrier": E, "sample.height": 5e-12}
    )
    d = 1e-15
    for x, y in rng.uniform(-1e-9, 1e-9, (6, 2)):
        here = place(x, y)
        scale = E * (2.0 * math.pi / A) ** 2
        right, left = place(x + d, y), place(x - d, y)
        above, below = place(x, y + d), place(x, y - d)
        assert (right.potential_x - left.potential_x) / (2 * d) == pytest.approx(here.potential_xx, abs=1e-6 * scale)
        assert (above.potential_y - below.potential_y) / (2 * d) == pytest.approx(here.potential_yy, abs=1e-6 * scale)
        assert (above.potential_x - below.potential_x) / (2 * d) == pytest.approx(here.potential_xy, abs=1e-6 * scale)
        assert (right.potential_y - left.potential_y) / (2 * d) == pytest.approx(here.potential_xy, abs=1e-6 * scale)
        # The height is the same wave.
        assert (right.height - left.height) / (2 * d) == pytest.approx(here.slope_x, abs=1e-6)
        assert here.slope_x * E == pytest.approx(here.potential_x * 5e-12, rel=1e-9)
        assert here.curvature_xy * E == pytest.approx(here.potential_xy * 5e-12, rel=1e-9)
        assert here.curvature == 0.0


@pytest.mark.parametrize(("lattice", "neighbours"), [("line", 2), ("square", 4), ("hexagonal", 6)])
def test_minima_lie_a_lattice_constant_apart_with_the_barrier_between(lattice, neighbours):
    place = Place(KIND | {"sample.lattice": lattice, "sample.angle": 0.4, "sample.barrier": E})
    for i in range(neighbours):
        turn = 0.4 + 2.0 * math.pi * i / neighbours
        ahead = np.array([math.cos(turn), math.sin(turn)])
        # Energy along the row, by the slopes: Simpson's rule.
        way = np.linspace(0.0, A, 401)
        force = np.array([ahead @ [place(*(s * ahead)).potential_x, place(*(s * ahead)).potential_y] for s in way])
        steps = A / 400.0 * (force[:-2:2] + 4.0 * force[1:-1:2] + force[2::2]) / 3.0
        energy = np.concatenate([[0.0], np.cumsum(steps)])
        assert energy.max() == pytest.approx(E, rel=1e-6)
        assert way[::2][np.argmax(energy)] == pytest.approx(0.5 * A)
        assert energy[-1] == pytest.approx(0.0, abs=1e-6 * E)
        assert force.max() == pytest.approx(math.pi * E / A, rel=1e-4)
        there = place(*(A * ahead))
        assert math.hypot(there.potential_x, there.potential_y) < 1e-9 * force.max()
        bend = [[there.potential_xx, there.potential_xy], [there.potential_xy, there.potential_yy]]
        assert np.linalg.eigvalsh(bend).min() >= (-1e-9 if lattice == "line" else 1.0)


def test_the_peak_force_sets_the_barrier():
    given = Place(KIND | {"sample.peak_force": 1e-9})
    assert given(A / 4.0, 0.0).potential_x == pytest.approx(1e-9, rel=1e-9)
