"""Claims about extreme numbers: each is refused in a sentence with its range, or the instrument goes on with it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from quick_lever import INSTRUMENT

from afm_model import Instrument, ParameterError, SimParameters, build, changed, flatten
from afm_model.core import registry
from afm_model.core.ranges import RANGES
from afm_model.core.schema import specifications
from afm_model.parameters import ControllerParameters

EXTREME = (1e300, -1e300, 5e-324, math.nan, math.inf, -math.inf, -0.0, 10**400)
LEVER = build(SimParameters, INSTRUMENT)
IGNORED = ("cantilever.", "scanner.", "contact.", "scales.")
"""Groups that the plant `lever` refuses as a whole: it has its own."""
NUMBERS = {
    spec.name: spec
    for spec in specifications(type(LEVER))
    if spec.kind in (int, float) and not spec.name.startswith(IGNORED)
}
LONG = ("plant.control_period", "plant.dt", "detector.sample_period", "piezo.dac_period", "plant.delay_ticks")
"""A tick of so many steps, or so many ticks of delay, are seconds of computing."""


FAMILIES = ("program", "law", "fault", "piezo", "onboard", "plant", "sample", "detector")
GROUPS = [registry.find(family, name).parameters for family in FAMILIES for name in registry.names(family)]


@pytest.mark.parametrize("group", [SimParameters, ControllerParameters, *GROUPS], ids=lambda group: group.__name__)
def test_every_number_has_a_range_that_its_default_is_in(group):
    for spec in specifications(group):
        if spec.kind is float:
            assert spec.unit in RANGES, spec
        if spec.kind in (int, float):
            assert None not in (spec.lower, spec.upper), spec
            assert spec.refusal(spec.default) == "", spec


def refused_or_finite(name, value):
    """An instrument with this parameter is refused in a sentence, or goes on with finite numbers."""
    try:
        instrument = Instrument(changed(LEVER, {name: value}))
    except ParameterError:
        return
    for _ in range(20):
        instrument.tick(np.full(3, 1e-3))
    assert np.isfinite(instrument.measurement).all(), (name, value)


@pytest.mark.parametrize("value", EXTREME, ids=lambda value: str(value)[:8])
def test_extreme_number_is_refused_with_its_range(value):
    for name, spec in NUMBERS.items():
        told = spec.refusal(value)
        if value != 0.0 or told:
            with pytest.raises(ParameterError, match=name):
                changed(LEVER, {name: value})
        if not told and (value == 0.0 or spec.kind is int):
            continue  # zero, or no whole number
        assert told.startswith(f"{name} = "), (name, told)
        assert " is not allowed: it must be a " in told
        assert f"<= {spec.upper:g}" in told or f"< {spec.upper:g}" in told, told


@settings(max_examples=60)
@given(
    name=st.sampled_from(sorted(set(NUMBERS) - set(LONG))), which=st.sampled_from(["lower", "upper", "least", "zero"])
)
def test_instrument_at_the_end_of_a_range_refuses_it_or_goes_on_with_finite_numbers(name, which):
    spec = NUMBERS[name]
    value = 0.0 if which == "zero" else getattr(spec, which)
    refused_or_finite(name, spec.kind(value))


def test_parameters_that_are_all_in_their_ranges_are_those_of_before():
    assert changed(LEVER, flatten(LEVER)) == LEVER
