"""Claims about parameters of the plant `lever`: what is refused, what is told."""

import pytest

from afm_model import Instrument, InstrumentParameters, ParameterError, build
from afm_model.plant import LEVER

from .lever_bench import BASE


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"plant.dt": 2e-6, "detector.sample_period": 2e-6}, "bending mode 2 turns by"),
        ({"plant.width": 1e-3}, "a cantilever is longer than wide"),
        ({"scanner.f_x": 800.0}, "scanner.f_x = 800.0 has no effect with plant.kind = lever"),
        ({"plant.f_x": 2e5}, "the scanner's resonance of 200000 Hz turns by"),
        ({"plant.lever": "ppp_nothing"}, "must be one of ppp_lfmr, contal_g, snl_10b"),
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
    with pytest.raises(ParameterError, match=r"the tip's apex of plant\.apex_mass = 1e-12 kg turns by .* <= ") as told:
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
