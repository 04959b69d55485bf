"""Claims about parameters of the plant `lever`: what is refused, what is told."""

import math
from typing import Any

import numpy as np
import pytest

from afm_model import Instrument, InstrumentParameters, ParameterError, build
from afm_model.cantilever.beam import MODE
from afm_model.plant import LEVER
from afm_model.plant.lever.check import RESOLVED
from afm_model.plant.presets import LEVERS

from .lever_bench import BASE, LeverBench


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (
            {"plant.dt": 2e-6, "detector.sample_period": 2e-6},
            "it is too long for bending mode 2 of the cantilever, whose resonance is at ",
        ),
        (
            {"plant.modes": 1, "plant.dt": 1e-5, "detector.sample_period": 1e-5},
            r"too long for bending mode 1 of the cantilever, .*; take plant\.dt <= 4\.59e-06 s",
        ),
        ({"plant.width": 1e-3}, "a cantilever is longer than wide"),
        ({"scanner.f_x": 800.0}, "scanner.f_x = 800.0 has no effect with plant.kind = lever"),
        ({"plant.f_x": 2e5}, "too long for the scanner, whose resonance is at 2e.05 Hz"),
        ({"plant.lever": "ppp_nothing"}, "must be one of ppp_lfmr, contal_g, snl_10b, ppp_fmr, nsc14, ppp_nchr"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(values, told):
    with pytest.raises(ParameterError, match=told):
        build(InstrumentParameters, BASE | values)


LATTICE = {"sample.kind": "lattice", "sample.barrier": 1e-19}


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"sample.barrier": 0.0}, "a lattice needs one of them"),
        ({"sample.peak_force": 1e-9}, "one follows from the other, give one of them"),
        ({"sample.constant": 0.0}, r"sample\.constant = 0\.0 m is not allowed"),
        ({"sample.barrier": -1e-19}, r"sample\.barrier = -1e-19 J is not allowed"),
        ({"sample.lattice": "cubic"}, "must be one of line, square, hexagonal"),
        ({"plant.tau": 1e8}, r"plant\.tau = 1e\+08 has no effect with sample\.kind = lattice"),
        ({"plant.strengthening": 0.1}, r"plant\.strengthening = 0\.1 has no effect with sample\.kind = lattice"),
        ({"plant.apex_damping": 1e5}, r"plant\.apex_damping = 100000 1/s is not allowed with plant\.apex_mass = 0 kg"),
        (
            {"sample.kind": "flat", "plant.apex_mass": 1e-12},
            r"plant\.apex_mass = 1e-12 has no effect with sample\.kind = flat",
        ),
        ({"plant.kind": "compliant"}, r"sample\.kind = lattice has no effect with plant\.kind = compliant"),
    ],
)
def test_what_cannot_be_on_a_lattice_is_refused_in_one_sentence(values, told):
    given = BASE | LATTICE | values
    if given["sample.kind"] == "flat":
        given.pop("sample.barrier")
    with pytest.raises(ParameterError, match=told):
        build(InstrumentParameters, given)


def test_a_step_too_long_for_the_apex_is_refused_with_one_that_is_not():
    values = BASE | LATTICE | {"plant.apex_mass": 1e-12}
    with pytest.raises(
        ParameterError, match=r"the tip's apex of plant\.apex_mass = 1e-12 kg; take plant.dt <= "
    ) as told:
        Instrument(build(InstrumentParameters, values))
    allowed = float(str(told.value).partition("plant.dt <= ")[2].split()[0])
    step = 0.99 * allowed
    period = {"plant.dt": step, "detector.sample_period": step, "plant.control_period": step}
    assert Instrument(build(InstrumentParameters, values | period)).in_contact


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({}, None),
        ({"sample.barrier": 1e-15}, "the barrier of the lattice = 6.24e+03 eV is implausible"),
        ({"sample.constant": 1e-7}, "the distance of the minima of the lattice = 1e-07 m is implausible"),
        ({"sample.height": 1e-9}, "the height of the lattice = 1e-09 m is implausible"),
        ({"plant.apex_stiffness": 0.01}, "plant.apex_stiffness = 0.01 N/m is implausible"),
        ({"plant.temperature": 300.0, "sample.barrier": 3e-21}, "is below k_B T at plant.temperature = 300 K"),
    ],
)
def test_what_is_implausible_of_a_lattice_is_told(values, told):
    found = LEVER.warnings(build(InstrumentParameters, BASE | LATTICE | values))
    assert (found == []) if told is None else any(told in sentence for sentence in found)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("sample.constant", 1e-10, 5e-9),
        ("sample.barrier", 1e-3 * 1.602176634e-19, 10.0 * 1.602176634e-19),
        ("sample.height", 1e-13, 1e-10),
        ("plant.apex_stiffness", 0.1, 1e3),
        ("plant.apex_mass", 1e-18, 1e-9),
    ],
)
def test_usual_values_of_a_lattice_end_where_the_sentence_says(name, low, high):
    for end, beyond in ((low, 1.0 / 1.01), (high, 1.01)):
        for value, told in ((end / beyond, False), (end * beyond, True)):
            parameters = build(InstrumentParameters, BASE | LATTICE | {name: value})
            sentences = [each for each in LEVER.warnings(parameters) if "usual are" in each]
            assert bool(sentences) is told, f"{name} = {value}"
            assert all(f"usual are {low:g} to {high:g}" in each for each in sentences if "barrier" not in name)


def test_the_sample_of_the_paper_is_sharper_than_any_tip():
    # In SI its radius of curvature is 0.02 nm.
    with pytest.raises(ParameterError, match=r"sample\.kind = paper is sharper than the tip: .* down to 2e-11 m"):
        Instrument(build(InstrumentParameters, BASE | {"sample.kind": "paper"}))


def test_a_setpoint_beyond_pull_off_is_refused():
    parameters = build(InstrumentParameters, BASE | {"reference.z_r": -60e-9})
    with pytest.raises(ParameterError, match="the tip does not touch the sample at rest"):
        Instrument(parameters)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({}, None),
        ({"plant.lever": "contal_g", "plant.scanner": "tube_100um", "plant.pair": "si_graphite"}, None),
        ({"plant.lever": "snl_10b", "plant.scanner": "stack_13um", "plant.pair": "si3n4_mica"}, None),
        ({"plant.k": 400.0, "plant.f0": 1e5, "plant.modes": 1}, "plant.k = 400 N/m is implausible"),
        ({"plant.f0": 2.3e3}, "its density"),
        ({"plant.k_x": 5.0}, "plant.k_x = 5 N/m is implausible"),
        ({"plant.tau": 1e11}, "plant.tau = 1e.11 Pa is implausible"),
        ({"plant.temperature": 22.0}, "plant.temperature = 22 K is implausible"),
        ({"plant.temperature": 295.0, "plant.torsion": "moving"}, None),
    ],
)
def test_what_is_implausible_is_told_and_presets_are_not(values, told):
    found = LEVER.warnings(build(InstrumentParameters, BASE | values))
    if told is None:
        assert found == []
    else:
        assert any(told.replace("1e.11", "1e+11") in sentence for sentence in found)


# Slopes of 1 rad and 20 nm, radius of the edges 20 nm.
STEEP = {"sample.kind": "grating", "sample.step": 20e-9, "sample.edge_radius": 20e-9, "sample.angle": 1.0}


def test_a_reference_that_makes_the_tip_jump_off_edges_is_told_with_the_speed():
    def told(speed: float, values: dict[str, Any]) -> list[str]:
        scan = {"reference.amplitude_x": -1e-6, "reference.omega_x": 0.5e6 * math.pi * speed}
        return LEVER.warnings(build(InstrumentParameters, BASE | scan | {"reference.shape_x": "triangle"} | values))

    # A quarter of the radius in a period of the contact: 20 nm 5.2 26 kHz / 4.
    assert told(6.7e-4, STEEP) == []
    (sentence,) = told(6.9e-4, STEEP)
    assert "moves at up to 0.00069 m/s over edges with a radius of 2e-08 m: from some 0.00068 m/s on" in sentence
    assert told(1e-2, {"sample.kind": "plane", "sample.angle_x": 0.1}) == []


# One mode at its longest step resolves its contact least: 2.8 nm at edges of 20 nm; two and three meet within 0.3 nm.
@pytest.mark.parametrize(("modes", "apart"), [(1, 4e-9), (2, 1e-9), (3, 1e-9)])
def test_below_that_speed_the_longest_step_goes_over_edges_as_a_short_one(modes, apart):
    def excursion(turn: float) -> float:
        step = turn / (2.0 * math.pi * LEVERS["ppp_lfmr"].f0 * MODE[modes - 1].frequency)
        b = LeverBench(**STEEP, **{"plant.modes": modes, "plant.dt": step, "sample.pitch": 1e-6, "sample.top": 0.4e-6})
        n = round(1e-6 / 5.9e-4 / step)
        return float(np.ptp(b.run(np.arange(1, n + 1)[:, None] * step * np.array([5.9e-4, 0.0, 0.0])).q[:, 0]))

    assert excursion(0.999 * RESOLVED[modes - 1]) == pytest.approx(excursion(0.2), abs=apart)
