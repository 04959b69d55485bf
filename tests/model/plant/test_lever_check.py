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
