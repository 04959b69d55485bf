"""Claims about friction loops: of the simulated microscope, and made up with noise."""

import math

import numpy as np
import pytest

from afm_model.analysis import friction_loop, means
from afm_model.analysis.estimate import mean
from afm_model.contact.maugis import branch

from .bench import K, grating_line, run


@pytest.mark.parametrize("lever", ["ppp_lfmr", "contal_g"])
def test_loop_on_silicon_oxide_at_10_nN_has_the_springs_in_series_and_the_width_of_friction(lever):
    # 6 nm, 40 lines a second, through detector and z loop: what a user has.
    load = 10e-9
    values = {
        "plant.lever": lever,
        "onboard.setpoint_force": load,
        "onboard.integral_gain": 30e-6,
        "reference.z_r": load / K,
        "reference.shape_x": "triangle",
        "reference.amplitude_x": 3e-9,
        "reference.amplitude_y": 0.0,
        "reference.omega_x": 2.0 * math.pi * 40.0,
        "run.duration": 0.05,
    }
    done = run(values)
    plant = done.parameters.plant
    c, pair, units = plant.cantilever_numbers, plant.pair_numbers, plant.contact_units
    exact = branch("maugis", plant.transition)
    a, force = exact.solve(exact.least_indentation + np.linspace(0.0, 4.0, 4000) ** 2)
    stable = slice(int(np.argmin(force)), None)
    radius = float(np.interp(load / units.force, force[stable], a[stable])) * units.radius
    arm = c.tip_height + 0.5 * c.thickness
    springs = c.k_torsion / arm**2, c.k_in_plane, 8.0 * pair.G * radius
    found = friction_loop(done.position[:, 0], done.lateral_force)
    assert found.half_width.value == pytest.approx(pair.tau * math.pi * radius**2, rel=5e-3)
    assert found.stick_slope.value == pytest.approx(1.0 / sum(1.0 / k for k in springs), rel=1e-2)
    assert abs(found.offset.value) < 2e-3 * found.half_width.value
    # Sub-nanometre: from one side of the loop to the other.
    assert 2.0 * found.half_width.value / found.stick_slope.value < 1e-9


def test_loop_on_a_slope_has_half_width_and_offset_of_the_closed_wedge_formulae():
    angle = math.radians(25.0)
    line = grating_line(angle, 10e-9)
    on_slope = line.slope - line.width, line.slope + line.width
    volts, loads = means(line.position, line.voltage, *on_slope), means(line.position, line.load, *on_slope)
    s, c, S = math.sin(angle), math.cos(angle), 5e-8
    plant = run({"run.duration": 1e-4, "reference.z_r": 50e-9}).parameters.plant
    exact = branch("maugis", plant.transition)
    a, force = exact.solve(exact.least_indentation + np.linspace(0.0, 4.0, 4000) ** 2)
    stable = slice(int(np.argmin(force)), None)
    for way, volt, load in zip((1.0, -1.0), volts, loads, strict=True):
        T = S * volt.value
        # Balance of forces: c T = s L +- F(N), N = c L + s T, with friction of the exact contact.
        N = c * load.value + s * T
        radius = float(np.interp(N / plant.contact_units.force, force[stable], a[stable])) * plant.contact_units.radius
        friction = plant.pair_numbers.tau * math.pi * radius**2
        assert c * T - s * load.value == pytest.approx(way * friction, rel=1e-2)


def made_up(rng: np.random.Generator, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """A play operator of slope 20 N/m and friction 4 nN, offset 1 nN, over 2.25 periods."""
    phase = np.linspace(0.0, 4.5 * np.pi, 9001)
    x = 3e-9 * 2.0 / np.pi * np.arcsin(np.sin(phase))
    force, play = 0.0, np.empty(x.size)
    for i, step in enumerate(np.diff(x, prepend=x[0])):
        force = min(max(force + 20.0 * step, -4e-9), 4e-9)
        play[i] = force
    return x, play + 1e-9 + noise * rng.standard_normal(x.size)


def test_loop_of_a_play_operator_is_recovered(rng):
    found = friction_loop(*made_up(rng, 0.0))
    assert found.half_width.value == pytest.approx(4e-9, rel=1e-12)
    assert found.offset.value == pytest.approx(1e-9, rel=1e-12)
    assert found.stick_slope.value == pytest.approx(20.0, rel=1e-9)


def test_means_of_few_values_have_the_factor_of_student_for_95_percent():
    # Two values 2 apart: 1, times half of Student's 13.97 for 95.45 % with one degree of freedom; with two 4.53.
    assert mean([1.0, 3.0]).uncertainty == pytest.approx(0.5 * 13.97, rel=1e-3)
    assert mean([1.0, 2.0, 3.0]).uncertainty == pytest.approx(0.5 * 4.527 / math.sqrt(3.0), rel=1e-3)


def test_what_is_no_loop_is_refused_in_a_sentence():
    x = np.linspace(0.0, 1.0, 100)
    with pytest.raises(ValueError, match="three turns of the position"):
        friction_loop(x, x)
    with pytest.raises(ValueError, match=r"there are 2$"):
        friction_loop(np.concatenate([x, x[::-1], x]), np.ones(300))
    back = np.concatenate([x, x[::-1], x, x[::-1]])
    with pytest.raises(ValueError, match="the loop is not open"):
        friction_loop(back, -np.gradient(back))
    with pytest.raises(ValueError, match="same length"):
        means(x, x[1:], 0.0, 1.0)
