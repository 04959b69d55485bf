"""Claims about the plant `lever` on lattices in two dimensions: its way from minimum to minimum, images."""

import math
from typing import Any

import numpy as np
import pytest

from .lever_bench import LeverBench
from .tomlinson import descent, waves

A = 0.5e-9
E = 1.6e-19


def bench(lattice: str, angle: float, **values: Any) -> LeverBench:
    """An upright cantilever with a soft apex, from y = 0: pressing moves its tip along y, by 1/12 of z_r."""
    given = {"sample__lattice": lattice, "sample__constant": A, "sample__barrier": E, "sample__angle": angle} | values
    return LeverBench(
        **given, sample__kind="lattice", plant__scanner="stack_13um", plant__tilt=0.0, plant__apex_stiffness=2.0
    )


def stiffness(b: LeverBench) -> np.ndarray:
    """Of everything elastic along x and y [N/m], static."""
    c = b.plant.cantilever_numbers
    arm = c.tip_height + 0.5 * c.thickness
    shared = 0.5 + 1.0 / (8.0 * b.plant.pair_numbers.G * b.s.a)
    return 1.0 / (shared + np.array([arm**2 / c.k_torsion + 1.0 / c.k_in_plane, 3.0 * (arm / c.length) ** 2 / c.k]))


@pytest.mark.parametrize(
    ("lattice", "angle"), [("square", math.pi / 4.0), ("square", 0.3), ("hexagonal", math.pi / 6.0), ("hexagonal", 0.2)]
)
def test_the_way_from_minimum_to_minimum_is_that_of_steepest_descent(lattice, angle):
    b = bench(lattice, angle)
    n, way = 16_000, 3e-9
    moved = np.zeros((n, 3))
    moved[:, 0] = np.linspace(0.0, way, n)
    start = np.array([b.s.A_x, b.s.A_y])
    free_y = float(b.s.U_y + b.s.F_y * 3.0 * (12.5e-6 / 225e-6) ** 2 / 0.2)
    r = b.run(moved)
    every = 80
    supports = np.column_stack([r.X[::every], np.full(n // every, free_y)])
    G = waves(lattice, A, angle)
    amplitude = E / 2.0 if lattice == "square" else E / 4.0
    expected = descent(G, amplitude, stiffness(b), supports, start)
    found = np.column_stack([r.A_x, r.A_y])[::every]
    # In the same minimum but for the step of a slip; the load gives way a little, which the reference does not know.
    apart = np.hypot(*(found - expected).T)
    assert np.mean(apart < 0.03 * A) > 0.95
    slips = np.flatnonzero(np.hypot(*np.diff(expected, axis=0).T) > 0.3 * A)
    assert len(slips) >= 4
    # Zigzag: on its way along x it goes to both sides.
    aside = np.diff(expected[:, 1])[slips]
    if lattice == "square" or angle > 0.5:
        assert aside.max() > 0.1 * A
        assert aside.min() < -0.1 * A


def image(b: LeverBench, size: float, lines: int, steps: int) -> np.ndarray:
    """Lateral force (lines, steps), lines from left to right."""
    back, settle = 200, steps // 4
    x = np.concatenate(
        [np.linspace(0.0, size, steps), np.linspace(size, -size / 4.0, back), np.linspace(-size / 4.0, 0.0, settle)]
    )
    rows = []
    for line in range(lines):
        y = np.full(x.shape, size * line / lines)
        rows.append(b.run(np.column_stack([x, y, np.zeros_like(x)])).F_x[:steps])
    return np.array(rows)


@pytest.mark.parametrize(("lattice", "angle"), [("square", 0.15), ("hexagonal", 0.25)])
def test_lattice_constant_and_angle_are_recovered_from_an_image_of_the_lateral_force(lattice, angle):
    size, lines, steps = 8e-9, 64, 512
    force = image(bench(lattice, angle), size, lines, steps)
    window = np.outer(np.hanning(lines), np.hanning(steps))
    padded = 2048
    power = np.abs(np.fft.fft2((force - force.mean()) * window, (padded, padded))) ** 2
    q_y = 2.0 * np.pi * np.fft.fftfreq(padded, size / lines)
    q_x = 2.0 * np.pi * np.fft.fftfreq(padded, size / steps)
    # The strongest wave along x, where the slips are.
    row, column = np.unravel_index(np.argmax(power), power.shape)
    found = np.array([q_x[column], q_y[row]])
    found *= np.sign(found[0])
    G = waves(lattice, A, angle)
    nearest = min((*G, *-G, *(G[:1] - G[1:2])), key=lambda each: np.linalg.norm(each - found))
    # An image of 16 periods tells a wave to a few hundredths of 1/16.
    assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(nearest), rel=0.01)
    assert math.atan2(found[1], found[0]) == pytest.approx(math.atan2(nearest[1], nearest[0]), abs=0.01)


def test_the_height_of_the_atoms_lifts_the_tip_and_adds_load_times_it_to_the_barrier():
    # Below eta = 1: no slips that make it ring.
    height = 2e-12
    b = bench("square", 0.0, sample__barrier=0.0, sample__height=height, reference__z_r=48e-9)
    # A potential of N times the height: pi N height / a.
    assert b.s.N == pytest.approx(9.6e-9, rel=1e-3)
    n = 16_000
    moved = np.zeros((n, 3))
    moved[:, 0] = np.linspace(0.0, 4.0 * A, n)
    r = b.run(moved)
    assert r.F_x.max() == pytest.approx(math.pi * 9.6e-9 * height / A, rel=1e-2)
    # The scanner's height is held: what lifts the tip is the wave under its apex.
    wave = 0.5 * height * (1.0 - np.cos(2.0 * np.pi * r.A_x / A))
    quiet = slice(n // 8, None)
    assert r.tip[quiet] - r.tip[quiet].mean() == pytest.approx(wave[quiet] - wave[quiet].mean(), abs=0.02 * height)


def test_a_tip_that_is_pulled_off_a_lattice_feels_no_lateral_force_and_finds_a_minimum_again():
    b = bench("hexagonal", 0.1, plant__temperature=300.0, plant__apex_mass=6e-11, plant__apex_damping=1e6)
    n = 4000
    moved = np.zeros((4 * n, 3))
    moved[:, 2] = np.concatenate(
        [np.linspace(0.0, -100e-9, n), np.full(n, -100e-9), np.linspace(-100e-9, 0.0, n), np.zeros(n)]
    )
    r = b.run(moved)
    free = r[(r.a == 0.0)]
    assert len(free) > n
    assert (free.F_x == 0.0).all()
    assert (free.A_y == free.U_y).all()
    end = r[-100:]
    assert (end.a > 0.0).all()
    assert end.N.mean() == pytest.approx(b.plant.cantilever_numbers.k * 50e-9, rel=2e-2)
    assert np.isfinite(b.numbers).all()
