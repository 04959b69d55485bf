"""Claims about parameters: one declaration, every bound kept, every refusal a sentence."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from afm_model import (
    ControllerParameters,
    InstrumentParameters,
    ParameterError,
    SimParameters,
    build,
    flatten,
    specifications,
)
from afm_model.parameters import Specification

OWN = {
    "plant": ("compliant", "paper"),
    "detector": ("photodiode",),
    "piezo": ("linear",),
    "onboard": ("none",),
    "sample": ("paper",),
    "program": ("periodic",),
    "fault": ("none", "scheduled"),
    "law": ("open_loop", "sgn", "tanh"),
}
"""Parts that can be chosen with every other parameter at its default."""
MODELS = (SimParameters, ControllerParameters)
SPECIFICATIONS = [
    pytest.param(model, spec, id=f"{model.__name__}-{spec.name}") for model in MODELS for spec in specifications(model)
]
NUMBERS = [p for p in SPECIFICATIONS if p.values[1].kind in (int, float)]
BOUNDED = [p for p in NUMBERS if (p.values[1].lower, p.values[1].upper) != (None, None)]
FLOATS = [p for p in SPECIFICATIONS if p.values[1].kind is float]
CHOICES = [p for p in SPECIFICATIONS if p.values[1].choices or p.values[1].family]


def choices(spec: Specification) -> tuple[str, ...]:
    """The words that a parameter can be; for one that chooses a part, some of them."""
    return OWN[spec.family] if spec.family else spec.choices


def below(spec: Specification) -> float | int:
    """A number just outside the lower bound."""
    if spec.kind is int:
        return int(spec.lower) - (0 if spec.lower_open else 1)
    return spec.lower if spec.lower_open else math.nextafter(spec.lower, -math.inf)


def above(spec: Specification) -> float | int:
    """A number just outside the upper bound."""
    if spec.kind is int:
        return int(spec.upper) + (0 if spec.upper_open else 1)
    return spec.upper if spec.upper_open else math.nextafter(spec.upper, math.inf)


@pytest.mark.parametrize(("model", "spec"), BOUNDED)
def test_each_bound_is_kept_and_its_refusal_names_the_value_and_what_is_allowed(model, spec):
    for bound, outside in ((spec.lower, below), (spec.upper, above)):
        if bound is None:
            continue
        value = outside(spec)
        with pytest.raises(ParameterError) as refusal:
            build(model, {spec.name: value})
        unit = "" if spec.unit == "1" else f" {spec.unit}"
        assert str(refusal.value) == f"{spec.name} = {value}{unit} is not allowed: it must be {spec.allowed}"
        assert f"{bound:g}" in spec.allowed


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(("model", "spec"), FLOATS)
def test_nan_and_infinity_are_refused(model, spec, value):
    with pytest.raises(ParameterError, match=f"{spec.name} = {value}.* is not allowed: it must be a finite number"):
        build(model, {spec.name: value})


@pytest.mark.parametrize(("model", "spec"), CHOICES)
def test_unknown_choice_is_refused_with_the_known_ones(model, spec):
    with pytest.raises(
        ParameterError, match=f"{spec.name} = nonsense is not allowed: .*it must be one of {choices(spec)[0]}, "
    ):
        build(model, {spec.name: "nonsense"})
    for choice in choices(spec):
        assert flatten(build(model, {spec.name: choice}))[spec.name] == choice


@pytest.mark.parametrize(("model", "spec"), SPECIFICATIONS)
def test_each_parameter_says_what_it_is_and_its_default_is_allowed(model, spec):
    assert spec.description
    assert spec.unit
    assert spec.kind in (bool, int, float, str)
    assert isinstance(spec.default, spec.kind)
    assert flatten(build(model, {spec.name: spec.default}))[spec.name] == spec.default
    if spec.lower is not None:
        assert spec.default > spec.lower or (spec.default == spec.lower and not spec.lower_open)


@pytest.mark.parametrize("model", MODELS)
def test_specifications_are_exactly_the_flat_names(model):
    assert [spec.name for spec in specifications(model)] == list(flatten(model()))


@pytest.mark.parametrize("model", MODELS)
def test_build_without_values_gives_the_defaults(model):
    assert build(model, {}) == model()
    assert flatten(model()) == {spec.name: spec.default for spec in specifications(model)}


def legal(spec: Specification) -> st.SearchStrategy:
    """Values within the bounds of a parameter."""
    if choices(spec):
        return st.sampled_from(choices(spec))
    if spec.kind is bool:
        return st.booleans()
    if spec.kind is int:
        return st.integers(int(spec.lower), int(spec.upper) - 1 if spec.upper else 2**40)
    low = spec.lower if spec.lower is not None else -1e12
    high = spec.upper if spec.upper is not None else 1e12
    numbers = st.floats(low, high, exclude_min=spec.lower_open, exclude_max=spec.upper_open)
    return numbers.filter(lambda value: value == 0.0 or abs(value) >= spec.least)


@given(st.fixed_dictionaries({}, optional={s.name: legal(s) for s in specifications(ControllerParameters)}))
def test_build_and_flatten_are_inverse(values):
    assume(not (values.get("piezo.dac_bits", 0) > 0 and values.get("piezo.limit", 0.0) == 0.0))
    built = build(ControllerParameters, values)
    flat = flatten(built)
    assert flat == flatten(ControllerParameters()) | values
    assert build(ControllerParameters, flat) == built


@pytest.mark.parametrize(
    "values",
    [{"contact.gamma": 1e-320}, {"sample.k_x": 1e300}, {"plant.dt": 5e-324}, {"contact.R": 1e200, "sample.beta": 0.0}],
)
def test_extreme_values_are_refused_as_parameters_too(values):
    with pytest.raises(ParameterError):
        build(InstrumentParameters, values)


@pytest.mark.parametrize(
    ("name", "nearest"),
    [("contact.taw", "contact.tau"), ("sample.kx", "sample.k_x"), ("plant.control_perid", "plant.control_period")],
)
def test_unknown_name_suggests_the_nearest(name, nearest):
    with pytest.raises(ParameterError, match=f"^unknown parameter {name}: did you mean {nearest}\\?$"):
        build(InstrumentParameters, {name: 1.0})


def test_name_like_no_other_lists_what_is_known():
    with pytest.raises(ParameterError, match=r"unknown parameter qqq: known are contact\.\*, .*score\.\*\.$"):
        build(InstrumentParameters, {"qqq": 1.0})


def test_name_of_a_group_alone_is_no_parameter():
    with pytest.raises(ParameterError, match="unknown parameter contact:"):
        build(InstrumentParameters, {"contact": 1.0})


def test_two_bad_values_are_both_named():
    with pytest.raises(ParameterError, match=r"contact\.tau = -1\.0 Pa .*; scanner\.mass_ratio = 0\.0 is not allowed"):
        build(InstrumentParameters, {"contact.tau": -1.0, "scanner.mass_ratio": 0.0})


def test_text_where_a_number_belongs_is_refused():
    with pytest.raises(
        ParameterError, match=r"contact\.tau = abc Pa is not allowed: it must be a finite number >= 0.001"
    ):
        build(InstrumentParameters, {"contact.tau": "abc"})
    with pytest.raises(ParameterError, match=r"plant\.seed = 1\.5 is not allowed: it must be a whole number >= 0"):
        build(InstrumentParameters, {"plant.seed": 1.5})


def test_parameters_do_not_change_once_made():
    parameters = InstrumentParameters()
    with pytest.raises(ValueError, match="frozen"):
        parameters.contact.tau = 1.0


def test_a_name_far_from_all_others_of_its_group_is_answered_by_what_the_group_has():
    with pytest.raises(ParameterError, match=r"^unknown parameter cantilever.k: cantilever has m_c, f_c, .* W\.$"):
        build(InstrumentParameters, {"cantilever.k": 0.2})


def test_a_reference_beyond_every_scanner_is_refused():
    with pytest.raises(ParameterError, match=r"reference.amplitude_x = 500.0 m is not allowed: .* < 0.001"):
        build(InstrumentParameters, {"reference.amplitude_x": 500.0})
