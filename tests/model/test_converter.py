"""Claims about the converters between numbers and voltages."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from afm_model.core.converter import convert

LIMIT = 10.0
bits = st.integers(1, 32)
volts = st.floats(-30.0, 30.0)


@given(volts, bits)
def test_converter_is_idempotent(v, n):
    lsb = 2.0 * LIMIT / 2**n
    once = convert(v, lsb, LIMIT)
    assert convert(once, lsb, LIMIT) == once


@given(volts, bits)
def test_converter_stays_within_its_range(v, n):
    lsb = 2.0 * LIMIT / 2**n
    assert -LIMIT <= convert(v, lsb, LIMIT) <= LIMIT - lsb


@given(volts, bits)
def test_converter_gives_the_nearest_level(v, n):
    lsb = 2.0 * LIMIT / 2**n
    out = convert(v, lsb, LIMIT)
    level = round(out / lsb)
    assert out == pytest.approx(level * lsb, abs=1e-15)
    assert -(2 ** (n - 1)) <= level <= 2 ** (n - 1) - 1
    if -LIMIT <= v <= LIMIT - lsb:
        # Half a level, and the round-off of v / lsb.
        assert abs(out - v) <= 0.5 * lsb + 1e-14


@given(volts, volts, bits)
def test_converter_keeps_the_order(v, w, n):
    lsb = 2.0 * LIMIT / 2**n
    low, high = sorted((v, w))
    assert convert(low, lsb, LIMIT) <= convert(high, lsb, LIMIT)


@given(volts)
def test_converter_that_is_off_changes_nothing(v):
    assert convert(v, 0.0, 0.0) == v


@given(volts)
def test_limit_without_resolution_only_saturates(v):
    assert convert(v, 0.0, LIMIT) == min(max(v, -LIMIT), LIMIT)


@given(st.floats(1.0, 300.0), st.sampled_from([-1.0, 1.0]))
@example(30.0, 1.0)
def test_converter_saturates_at_the_end_on_the_side_of_its_input(exponent, sign):
    lsb = 2.0 * LIMIT / 2**16
    expected = LIMIT - lsb if sign > 0.0 else -LIMIT
    assert convert(sign * 10.0**exponent * 1.01, lsb, LIMIT) == expected
