"""Claims about force curves: what is recovered of the simulated microscope, and of made-up records with noise."""

import math

import numpy as np
import pytest

from afm_model.analysis import deflection_sensitivity, force_curve, tilted_stiffness
from afm_model.analysis.curve_parts import curve_parts
from afm_model.analysis.force_curves import in_contact
from afm_model.contact.maugis import branch, pull_off

from .bench import K, curve
from .test_modulus import made_up as exact_curve

SENSITIVITY = 10e-9
"""Of the simulated detector [m/V]."""


def test_sensitivity_of_the_deflection_is_recovered_within_half_a_percent():
    record = curve({})
    found = deflection_sensitivity(record.z, record.voltage)
    assert found.value == pytest.approx(SENSITIVITY, rel=5e-3)
    # What the contact gives way is in it: k over its stiffness, 0.15 to 0.25 % at these loads.
    assert 1e-3 < found.value / SENSITIVITY - 1.0 < 4e-3
    assert abs(found.value - SENSITIVITY) < 3.0 * found.uncertainty + 2.5e-3 * SENSITIVITY


def test_sensitivity_does_not_depend_on_where_the_contact_resonances_are_to_the_rate_of_the_step():
    # It is static. At 1 us and 26 kHz the second one is at a third of the rate.
    found = [deflection_sensitivity(r.z, r.voltage).value for r in (curve({"plant.f0": f}) for f in (20e3, 26e3, 30e3))]
    assert found == pytest.approx(found[:1] * 3, rel=1e-5)


def test_sensitivity_of_a_tilted_cantilever_is_that_for_vertical_motion():
    # Without friction: static deflection under a vertical force, end and slope of a beam (docs/lever.md (3), (4)).
    record = curve({"plant.tilt": 0.2, "plant.tau": 1e3})
    c = record.done.parameters.plant.cantilever_numbers
    arm = (c.tip_height + 0.5 * c.thickness) / c.length
    across, couple = math.cos(0.2), -math.sin(0.2) * arm
    end, turn = across + 1.5 * couple, 1.5 * across + 3.0 * couple
    moved = math.cos(0.2) * end - math.sin(0.2) * arm * turn
    found = deflection_sensitivity(record.z, record.voltage)
    assert found.value == pytest.approx(SENSITIVITY * moved / (2.0 / 3.0 * turn), rel=3e-3)
    assert found.value < 0.98 * SENSITIVITY


@pytest.mark.parametrize("contact", ["jkr", "dmt", "maugis"])
def test_adhesion_is_recovered_within_a_percent(contact):
    record = curve({"plant.contact": contact, "plant.pair": "si_graphite"})
    plant = record.done.parameters.plant
    unit = plant.contact_units.force
    exact = branch(contact, plant.transition)
    least = exact.solve(exact.least_indentation + np.linspace(0.0, 3.0, 20_001) ** 2)[1].min() * unit
    if contact != "maugis":
        assert -least == pytest.approx({"jkr": 1.5, "dmt": 2.0}[contact] * unit, rel=1e-4)
    found = force_curve(record.z, record.deflection, K)
    assert found.adhesion.value == pytest.approx(-least, rel=2e-3)


@pytest.mark.parametrize(
    ("model", "k", "modulus", "work", "radius"),
    [
        ("jkr", 2.0, 5e6, 0.05, 500e-9),  # bent, and the tip comes off behind the largest pull
        ("jkr", 40.0, 5e6, 0.05, 500e-9),
        ("jkr", 0.05, 5e6, 0.05, 500e-9),
        ("dmt", 40.0, 3.5e9, 0.08, 10e-9),  # bent, and the tip comes off at the largest pull
        ("dmt", 0.2, 50e9, 0.1, 10e-9),  # straight
        ("maugis", 5.0, 3.5e9, 0.08, 10e-9),
        ("maugis", 40.0, 3.5e9, 0.08, 10e-9),
    ],
)
def test_adhesion_is_the_largest_pull_of_the_exact_contact_within_its_uncertainty(rng, model, k, modulus, work, radius):
    tabor = (radius * work**2 / (modulus**2 * 0.165e-9**3)) ** (1.0 / 3.0)
    most = pull_off(model, 1.157 * tabor) * math.pi * work * radius
    z, d = exact_curve(model, k, modulus, 2.0 * most, 2000, work, radius)
    step = k * float(z[1] - z[0])
    # Without noise what is left is the sample in which a soft cantilever comes off.
    assert force_curve(z, d, k).adhesion.value == pytest.approx(most, rel=2e-4, abs=0.3 * step)
    for part in (0.005, 0.02):
        noise = part * most / k * rng.standard_normal((12, z.size))
        found = np.array([force_curve(z, d + each, k).adhesion for each in noise])
        off = (found[:, 0] - most) / found[:, 1]
        assert abs(off.mean()) < 1.0
        assert np.mean(np.abs(off) < 2.0) > 0.8
        # And is stated small: the noise of a few samples.
        assert np.median(found[:, 1]) < 3.0 * part * most


def test_friction_along_the_cantilever_leaves_the_adhesion_within_a_percent_on_silicon_oxide():
    record = curve({})
    plant = record.done.parameters.plant
    exact = branch("maugis", plant.transition)
    least = exact.solve(exact.least_indentation + np.linspace(0.0, 3.0, 20_001) ** 2)[1].min()
    found = force_curve(record.z, record.deflection, K)
    assert found.adhesion.value == pytest.approx(-least * plant.contact_units.force, rel=1e-2)


@pytest.mark.parametrize("tilt", [0.2, -0.3])
def test_adhesion_of_a_tilted_cantilever_is_recovered_within_a_percent_with_its_vertical_stiffness(tilt):
    record = curve({"plant.tilt": tilt, "plant.pair": "si_graphite", "plant.contact": "dmt"})
    plant = record.done.parameters.plant
    c = plant.cantilever_numbers
    k = tilted_stiffness(c.k, tilt, c.tip_height + 0.5 * c.thickness, c.length)
    S = deflection_sensitivity(record.z, record.voltage)
    found = force_curve(record.z, S.value * record.voltage, k)
    assert found.adhesion.value == pytest.approx(2.0 * plant.contact_units.force, rel=1e-2)
    assert abs(K / k - 1.0) > 0.03


def test_tip_snaps_in_at_the_distance_of_the_closed_form():
    # DMT: the branch begins at no indentation with -2 pi w R; the attraction goes on from there. Without friction: a
    # tip that sticks holds back the cantilever, which turns while it bends.
    slow = {"reference.ramp": 60e-9, "reference.approach_rate": 0.2e-6, "reference.trigger_force": 2e-9}
    record = curve({"plant.contact": "dmt", "plant.tau": 1e3} | slow)
    plant = record.done.parameters.plant
    pair, R, units = plant.pair_numbers, plant.cantilever_numbers.tip_radius, plant.contact_units
    D = (pair.hamaker * R / (3.0 * K)) ** (1.0 / 3.0)
    at_contact = math.sqrt(pair.hamaker * R / (6.0 * 2.0 * units.force))
    # At zero force a^3 = 2 and the indentation is a^2, in their units.
    way = 1.5 * D - at_contact + 2.0 ** (2.0 / 3.0) * units.indentation
    found = force_curve(record.z, record.deflection, K)
    # To pass the fold takes time: 0.036 nm of way at 1 um/s, 0.013 nm at this rate.
    # The attraction within the free part bends its baseline by some pm.
    assert found.snap_in_way == pytest.approx(way, abs=0.02e-9)


def made_up(rng: np.random.Generator, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """A curve of straight lines: free, snap-in by 1 nm at z = 100 nm, adhesion of 5 nm deflection."""
    z_in = np.linspace(0.0, 150e-9, 3001)
    z_out = z_in[::-1]
    d_in = np.where(z_in < 100e-9, 0.0, z_in - 101e-9)
    d_out = np.where(z_out > 96e-9, z_out - 101e-9, 0.0)
    z, d = np.concatenate([z_in, z_out]), np.concatenate([d_in, d_out])
    return z, d + 2e-9 + noise * rng.standard_normal(z.size)


def test_points_of_a_made_up_curve_are_found(rng):
    z, d = made_up(rng, 0.0)
    found = force_curve(z, d, 2.0)
    assert found.baseline.value == pytest.approx(2e-9, rel=1e-12)
    assert found.contact_point == pytest.approx(101e-9, abs=1e-15)
    assert found.snap_in_way == pytest.approx(1e-9, abs=0.06e-9)  # a step of z
    assert found.adhesion.value == pytest.approx(10e-9, rel=0.01)
    assert found.snap_off_way == pytest.approx(5e-9, abs=0.06e-9)
    assert found.work == pytest.approx(2.0 * 0.5 * (5e-9) ** 2, rel=0.03)
    assert deflection_sensitivity(z, d / 40e-9).value == pytest.approx(40e-9, rel=1e-9)


def test_uncertainties_are_those_of_repeated_noise(rng):
    adhesion, slope, told = [], [], []
    for _ in range(60):
        z, d = made_up(rng, 0.1e-9)
        found, gain = force_curve(z, d, 2.0), deflection_sensitivity(z, d / 40e-9)
        adhesion.append(found.adhesion.value)
        slope.append(gain.value)
        told.append((found.adhesion.uncertainty, gain.uncertainty))
    scatter, of_told = np.array([np.std(adhesion), np.std(slope)]), np.mean(told, axis=0)
    # 60 repetitions know a standard deviation to 10 %; half the difference of the branches is told for the slope, more
    # than its scatter; the lowest point of the adhesion moves by a step of z.
    assert 0.4 < of_told[0] / scatter[0] < 1.5
    assert 0.8 < of_told[1] / scatter[1] < 3.0
    assert np.mean(adhesion) == pytest.approx(10e-9, rel=0.02)
    assert np.mean(slope) == pytest.approx(40e-9, abs=3.0 * scatter[1])


@pytest.mark.parametrize(
    ("z", "d", "told"),
    [
        (np.linspace(0.0, 1.0, 50), np.zeros(50), "there is no approach, or no retract"),
        (np.zeros((5, 2)), np.zeros((5, 2)), "two lists of the same length"),
        (np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(1.0, 0.0, 50)]), np.zeros(100), "not pressed on"),
    ],
)
def test_what_is_no_force_curve_is_refused_in_a_sentence(z, d, told):
    with pytest.raises(ValueError, match=told):
        force_curve(z, d, 1.0)


def test_a_retract_that_ends_while_the_tip_is_pulled_is_refused_and_noise_is_no_pull(rng):
    z, d = made_up(rng, 0.1e-9)
    cut = 3001 + int(np.sum(z[3001:] > 97e-9))  # pulled by 4 nm of 5
    with pytest.raises(ValueError, match="the retract ends before the tip comes off"):
        in_contact(curve_parts(z[:cut], d[:cut]))
    clean = curve_parts(z, made_up(rng, 0.0)[1])
    pressed, pulled = in_contact(clean)
    assert clean.z_in[pressed][0] == pytest.approx(101e-9, abs=0.06e-9)
    assert clean.z_in[pressed][-1] == 150e-9
    parts = curve_parts(z, d)
    _, pulled = in_contact(parts)
    assert parts.z_out[pulled][-1] == pytest.approx(96e-9, abs=0.2e-9)
    # Without adhesion the last sample is the lowest by chance, within 5 deviations.
    free = np.maximum(z - 100e-9, 0.0) + 0.1e-9 * rng.uniform(-1.0, 1.0, z.size)
    free[-1] = free.min() - 0.02e-9
    parts = curve_parts(z, free)
    _, pulled = in_contact(parts)
    assert pulled.stop == parts.z_out.size


def test_a_sensitivity_needs_contact_and_levels_in_order():
    z = np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(1.0, 0.0, 50)])
    with pytest.raises(ValueError, match="does not reach the sample"):
        deflection_sensitivity(z, np.zeros(100))
    with pytest.raises(ValueError, match="0 < low < high <= 1"):
        deflection_sensitivity(z, z, low=0.9, high=0.3)
    with pytest.raises(ValueError, match="compression = 1 is not allowed"):
        deflection_sensitivity(z, z, compression=1.0)
    with pytest.raises(ValueError, match="sample the curve denser"):
        deflection_sensitivity(z, np.maximum(z - 0.5, 0.0), low=0.5, high=0.52)


def test_pull_of_few_samples_has_the_adhesion_of_the_lowest_one(rng):
    z, d = made_up(rng, 0.0)
    z, d = z[::40], d[::40]  # 2 nm a sample, in a pull of 5 nm
    assert force_curve(z, d, 2.0).adhesion.value == pytest.approx(2.0 * (2e-9 - d[z.size // 2 :].min()), rel=1e-12)


def test_pull_along_a_straight_line_is_taken_to_the_middle_of_the_step_in_which_the_tip_comes_off(rng):
    z, d = made_up(rng, 0.0)
    z, d = z[::8], d[::8]  # 0.4 nm a sample
    last = z[z.size // 2 :][d[z.size // 2 :].argmin()] - 0.2e-9
    found = force_curve(z, d, 2.0)
    assert found.adhesion.value == pytest.approx(2.0 * (101e-9 - last), rel=1e-6)
    assert found.contact_point == pytest.approx(101e-9, abs=1e-15)  # half way between two samples
