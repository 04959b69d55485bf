"""Claims about parameters that must fit together: tip and sample, periods, step, drive."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_model import InstrumentParameters, ParameterError, SimParameters, build


@given(st.floats(1e-9, 1e-6), st.just(0.0) | st.floats(1e-18, 1e-7), st.just(0.0) | st.floats(1e-6, 1e10))
def test_sample_that_the_tip_cannot_touch_in_one_point_is_refused(R, beta, k):
    values = {"contact.R": R, "sample.beta": beta, "sample.k_x": k, "sample.k_y": 0.5 * k, "plant.dt": 1e-8}
    values |= {"detector.sample_period": 1e-6}
    # The deepest valley has kappa = -(k_x^2 + k_y^2) |beta| / 2 in units of x0 and z0.
    kappa_r = 0.5 * 1.25 * (k * 2.5e-10) ** 2 * abs(beta) / 1e-7 * R / 1e-7
    if kappa_r < 1.0 - 1e-12:
        build(InstrumentParameters, values)
    elif kappa_r > 1.0 + 1e-12:
        with pytest.raises(
            ParameterError, match=r"cannot touch the sample in one point: 1 \+ kappa r = .* must be > 0"
        ):
            build(InstrumentParameters, values)


def test_sample_of_the_paper_is_touched_with_a_wide_margin():
    p = InstrumentParameters()
    assert 0.25 * 0.125 * p.contact.R / 1e-7 == pytest.approx(0.0125, rel=1e-12)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (
            {"plant.dt": 3e-7},
            "detector.sample_period = 1e-06 s is not allowed: it must be a multiple of plant.dt = 3e-07 s",
        ),
        (
            {"plant.control_period": 2.5e-6},
            "plant.control_period = 2.5e-06 s is not allowed: it must be a multiple of detector.sample_period = 1e-06",
        ),
        ({"plant.control_period": 1e-7}, "plant.control_period = 1e-07 s"),
    ],
)
def test_periods_that_do_not_divide_are_refused(values, words):
    with pytest.raises(ParameterError, match=words):
        build(InstrumentParameters, values)


@given(st.integers(1, 2000), st.integers(1, 50), st.integers(1, 50))
def test_multiples_are_multiples_whatever_their_round_off(tenths, stride, samples):
    dt = tenths * 1e-9
    period = dt * stride
    values = {"plant.dt": dt, "detector.sample_period": period, "plant.control_period": period * samples}
    assert build(InstrumentParameters, values).plant.substeps == stride * samples


def test_run_of_a_part_of_a_tick_is_one_tick_and_no_endless_one():
    assert build(SimParameters, {"run.duration": 1e-13}).total_ticks == 1
    assert build(SimParameters, {"run.duration": 0.0}).total_ticks == 0


def test_resolution_of_the_drive_needs_a_range():
    with pytest.raises(ParameterError, match=r"piezo\.limit must be > 0 V"):
        build(InstrumentParameters, {"piezo.dac_bits": 16})
    build(InstrumentParameters, {"piezo.dac_bits": 16, "piezo.limit": 10.0})


def test_work_of_adhesion_takes_the_place_of_gamma():
    contact = build(InstrumentParameters, {"contact.work_of_adhesion": 0.5, "contact.gamma": 9.0}).contact
    assert contact.surface_energy == 0.25
    # Work of adhesion W: pull-off at 3/2 pi W R.
    assert contact.pull_off_force == pytest.approx(1.5 * math.pi * 0.5 * contact.R, rel=1e-14)


def test_period_of_the_reference_is_that_of_the_fast_axis():
    assert InstrumentParameters().reference.period == pytest.approx(2.0 * math.pi / 50.0, rel=1e-15)
    for values in ({"reference.shape_x": "constant"}, {"reference.omega_x": 0.0}):
        still = build(InstrumentParameters, values)
        assert (still.reference.period, still.score_start) == (0.0, 0.0)
