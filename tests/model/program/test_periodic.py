"""Claims about the reference waveforms."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from afm_model.program.periodic import CONSTANT, SINE, TRIANGLE, Reference, waveform

A, OMEGA = 5e-9, 50.0
PERIOD = 2.0 * math.pi / OMEGA
times = st.floats(0.0, 10.0 * PERIOD)


@given(times)
def test_velocity_and_acceleration_of_the_sine_are_its_derivatives(t):
    step = 1e-5 * PERIOD
    before, here, after = (waveform(SINE, A, OMEGA, t + d) for d in (-step, 0.0, step))
    # Central difference, relative to the amplitude: (omega step)^2 / 6 = 7e-10.
    assert here[1] == pytest.approx((after[0] - before[0]) / (2.0 * step), abs=2e-9 * A * OMEGA)
    assert here[2] == pytest.approx((after[1] - before[1]) / (2.0 * step), abs=2e-9 * A * OMEGA**2)


def corner_distance(t: float) -> float:
    """Phase from the nearest corner of the triangle."""
    return abs(math.remainder(OMEGA * t - 0.5 * math.pi, math.pi))


@given(times)
def test_triangle_is_piecewise_linear(t):
    step = 1e-4 * PERIOD
    assume(corner_distance(t) > 2.0 * OMEGA * step)
    before, here, after = (waveform(TRIANGLE, A, OMEGA, t + d) for d in (-step, 0.0, step))
    # asin loses half of the digits at the corners: 1e-16 / 1e-3 of phase, over the step.
    assert here[1] == pytest.approx((after[0] - before[0]) / (2.0 * step), rel=1e-8)
    assert abs(here[1]) == pytest.approx(4.0 * A / PERIOD, rel=1e-14)
    assert here[2] == 0.0


@pytest.mark.parametrize("shape", [SINE, TRIANGLE])
def test_references_start_at_zero_with_a_positive_slope(shape):
    position, velocity, _ = waveform(shape, A, OMEGA, 0.0)
    assert position == 0.0
    assert velocity > 0.0


@pytest.mark.parametrize("shape", [SINE, TRIANGLE])
@given(t=times)
def test_references_repeat_and_are_odd_about_half_a_period(shape, t):
    here, later = waveform(shape, A, OMEGA, t)[0], waveform(shape, A, OMEGA, t + PERIOD)[0]
    half = waveform(shape, A, OMEGA, t + 0.5 * PERIOD)[0]
    # Round-off of the phase, up to 1e-14; at a corner of the triangle the root of it.
    assert later == pytest.approx(here, abs=2e-7 * A)
    assert half == pytest.approx(-here, abs=2e-7 * A)


@given(times)
def test_triangle_reaches_its_amplitude_and_no_further(t):
    assert abs(waveform(TRIANGLE, A, OMEGA, t)[0]) <= A * (1.0 + 1e-15)
    assert waveform(TRIANGLE, A, OMEGA, 0.25 * PERIOD)[0] == pytest.approx(A, rel=1e-7)  # asin at 1: root of round-off


@given(times)
def test_constant_is_its_amplitude(t):
    assert waveform(CONSTANT, A, OMEGA, t) == (A, 0.0, 0.0)


@pytest.mark.parametrize("shape", ["sine", "triangle", "constant"])
@pytest.mark.parametrize("axis", "xy")
def test_top_speed_is_the_largest_one_of_the_waveform(shape, axis):
    still = {f"shape_{each}": "constant" for each in "xy"}
    given = Reference(**still | {f"shape_{axis}": shape, f"amplitude_{axis}": 3e-9, f"omega_{axis}": 70.0})
    code = {"sine": SINE, "triangle": TRIANGLE, "constant": CONSTANT}[shape]
    speeds = [abs(waveform(code, 3e-9, 70.0, k * 1e-4)[1]) for k in range(1000)]
    assert given.top_speed == pytest.approx(max(speeds), rel=1e-6)
