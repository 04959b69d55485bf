"""Claims about the filter that estimates position and friction from positions and the lateral force."""

import math

import numpy as np
import pytest

from afm_model import Controller, Instrument
from afm_predictive.constants import AT_X, AT_Y, MEAN, RATIO, SLOPE, SPEED, VALUE
from afm_predictive.kalman import correct, weigh
from afm_predictive.nominal_plant import look, nominal_bound
from afm_predictive.observer import (
    begin_observer,
    carry,
    copied_friction,
    doubt,
    follow_force,
    rests_for_certain,
    see_ratio,
    take_ratio_seen,
)

from . import law_records
from .test_predictive import NOISE, NOTHING, PERIOD, error, parameters, run, smoothness

SLIPS = 1.0
"""What the drive leaves over friction of a tip that slips for certain."""
MEASURED = {"law.feedback": "measured", **NOTHING}
DIAGONAL = math.sqrt(0.5)


def records(**law):
    """Constants and state of the law over a known surface, the tip slipping along x."""
    told = {"feedback": "measured", "period": 2e-4, "surface": "known"}
    p, s = law_records.records(**told | law)
    begin_observer(p, s)
    s.V_X, s.v[0], s.fastest, s.ratio[VALUE] = 0.1, 0.1, 0.1, 0.75
    s.weights[RATIO] = 1.0
    return p, s


def covariance(rng):
    """Some covariance."""
    root = rng.normal(size=(5, 5))
    return root @ root.T


def test_the_covariance_is_carried_as_the_free_scanner_and_friction_say(rng):
    p, s = records()
    P, nominal, way = covariance(rng), 12.0, 0.3
    s.P[:] = P
    carry(way, 1.0, 0.0, nominal, p, s)
    brakes = -nominal * np.array(p.of_drive)
    F = np.eye(5)
    F[np.ix_([AT_X, SPEED], [AT_X, SPEED])] = p.free
    F[[AT_X, SPEED], RATIO] = brakes
    F[[AT_X, SPEED], SLOPE] = 0.5 * way * brakes
    F[RATIO, SLOPE] = way
    # What is uneven about friction is a part of it.
    Q = (p.uneven[s.unknown] * s.ratio[MEAN]) ** 2 * np.outer(F[:, RATIO], F[:, RATIO])
    Q[3:] = Q[:, 3:] = 0.0
    Q[AT_Y, AT_Y] += p.astray**2
    assert s.P == pytest.approx(F @ P @ F.T + Q, rel=1e-12)


@pytest.mark.parametrize(
    ("mean", "part"),
    [(0.5, 0.4), (1.0, 0.8), (2.0, 1.0)],
)
def test_the_bend_of_a_surface_that_is_not_known_makes_ratio_and_slope_uncertain(mean, part):
    p, s = records(surface="observed")
    s.P[:] = 0.0
    s.ratio[MEAN] = mean
    carry(0.2, DIAGONAL, DIAGONAL, 12.0, p, s)
    q = p.wave_number * math.sqrt(2.0)
    assert math.sqrt(s.P[SLOPE, SLOPE]) == pytest.approx(part * p.ripple * q * q * 0.2, rel=1e-12)
    assert math.sqrt(s.P[RATIO, RATIO]) == pytest.approx(0.5 * part * p.ripple * q * q * 0.04, rel=1e-12)


def test_friction_that_is_not_known_makes_the_speed_uncertain_and_nothing_across():
    p, s = records(surface="observed")
    across = s.P[AT_X, AT_X]
    s.P[RATIO, RATIO] = 1.0
    carry(0.2, DIAGONAL, DIAGONAL, float(p.f_0), p, s)
    assert s.P[SPEED, SPEED] == pytest.approx((p.of_drive[1] * p.f_0) ** 2, rel=1e-2)
    assert 0.5 * (s.P[AT_X, AT_X] + s.P[AT_Y, AT_Y]) - s.P[AT_X, AT_Y] == pytest.approx(across, rel=0.01)


def test_measurements_correct_as_the_kalman_filter_says(rng):
    _, s = records()
    P, change = covariance(rng), np.zeros(5)
    s.P[:], s.change[:] = P, 0.0
    for innovation, noise in ((0.7, 0.3), (-0.2, 0.1)):
        H = rng.normal(size=5)
        s.weights[:] = H
        # Of the copy with the corrections so far.
        correct(innovation - H @ change, weigh(noise, s), s)
        gain = P @ H / (H @ P @ H + noise)
        change += gain * (innovation - H @ change)
        P = P - np.outer(gain, H @ P)
        assert s.P == pytest.approx(P, rel=1e-9, abs=1e-12)
        assert s.change == pytest.approx(change)


def test_a_position_that_is_missed_is_believed():
    p, s = records()
    doubt(0.5, 1.0, 0.0, p, s)
    noise = p.position_noise**2
    assert s.P[AT_X, AT_X] == pytest.approx(noise + 0.25)
    # As fast as the reference at most, and friction is wrong by what explains it.
    assert s.P[SPEED, SPEED] == pytest.approx(s.fastest**2)
    assert np.linalg.eigvalsh(np.array(s.P)).min() > -1e-12


@pytest.mark.parametrize("angle", [0.4, 2.8])
def test_the_ratio_seen_in_the_lateral_force_depends_on_the_place_as_its_row_says(angle):
    p, s = records()
    t = np.array([math.cos(angle), math.sin(angle)])
    at, believed = np.array([3.0, 4.0]), 0.9

    def balance(place):
        b = 10.0 * t - np.array(p.stiffness)[:2] * (place - at)
        return b, math.hypot(*b)

    def bound(place):
        look(place[0], place[1], p, s)
        return float(nominal_bound(s.load, p, s))

    s.ratio[VALUE] = s.ratio[8] = believed
    s.X, s.Y, s.load = at[0], at[1], p.load_0
    nominal = bound(at)
    see_ratio(t[0], t[1], 10.0, nominal, p, s)
    # Slipping the force along x is the bound there, along b; it is compared as a ratio to the bound at the estimate.
    for state, step in ((AT_X, np.array([1e-4, 0.0])), (AT_Y, np.array([0.0, 1e-4]))):
        force = []
        for place in (at + step, at - step):
            b, size = balance(place)
            force.append(believed * bound(place) * b[0] / size / (t[0] * nominal))
        # A forward difference over 0.01 x0.
        assert s.weights[state] == pytest.approx((force[0] - force[1]) / 2e-4, abs=1e-4)
    assert (s.weights[SPEED], s.weights[RATIO], s.weights[SLOPE]) == (0.0, 1.0, 0.0)


def test_friction_that_holds_more_than_is_believed_raises_the_bound_at_once_even_at_rest():
    p, s = records()
    s.V_X = 0.0
    take_ratio_seen(0.15, 1e-7, 0.0, SLIPS, p, s)
    assert s.change[RATIO] == pytest.approx(0.15, abs=1e-4)


def test_less_friction_than_is_believed_tells_nothing_at_rest():
    p, s = records()
    s.V_X = 0.0
    before = s.P[RATIO, RATIO]
    assert not take_ratio_seen(-0.5, 1e-7, 0.0, SLIPS, p, s)
    assert (s.change[RATIO], s.P[RATIO, RATIO]) == (0.0, before)


def test_less_friction_while_the_tip_slips_is_believed_at_once():
    p, s = records()
    take_ratio_seen(-0.5, 1e-7, 0.0, SLIPS, p, s)
    assert s.change[RATIO] == pytest.approx(-0.5, abs=1e-4)


def test_less_friction_at_a_speed_that_may_be_zero_is_rest():
    p, s = records()
    s.P[RATIO, RATIO], s.P[SPEED, SPEED] = 1e-8, 0.05**2
    assert not take_ratio_seen(-0.01, 1e-7, 0.0, SLIPS, p, s)
    assert (s.V_X, s.P[SPEED, SPEED], s.change[RATIO]) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("doubtful", ["ratio", "place"])
def test_a_copy_rests_for_certain_only_where_no_likely_bound_lets_the_tip_slip(doubtful):
    p, s = records()
    s.load, deviation = float(p.load_0), 0.01
    s.P[:] = 0.0
    if doubtful == "ratio":
        s.P[RATIO, RATIO] = deviation**2
    else:
        # Along both axes alike: so far along t that the spring takes the same.
        s.P[AT_X, AT_X] = s.P[AT_Y, AT_Y] = (deviation * float(p.f_0 / p.stiffness[0])) ** 2
    look(s.X, s.Y, p, s)
    f = s.here * nominal_bound(s.load, p, s)
    s.V_X = 0.0
    leaves = [part * nominal_bound(s.load, p, s) for part in (0.04, 0.02)]
    assert [rests_for_certain(0.6, 0.8, f - each, p, s) for each in leaves] == [True, False]
    s.V_X = 1e-3
    assert not rests_for_certain(0.6, 0.8, 0.0, p, s)


@pytest.mark.parametrize(("held", "rests"), [(0.0, True), (SLIPS, False)])
def test_much_less_friction_than_is_believed_is_rest_where_it_is_all_that_the_drive_leaves(held, rests):
    p, s = records()
    s.P[RATIO, RATIO], s.P[SPEED, SPEED] = 1e-8, 1e-8
    # Friction that is less by so little is noise, or that of a load that rings.
    take_ratio_seen(-0.0005, 1e-7, 0.0, held, p, s)
    assert s.V_X == 0.1
    take_ratio_seen(-0.02, 1e-7, 0.0, held, p, s)
    assert (s.V_X, bool(s.P[SPEED, SPEED] == 0.0)) == ((0.0, True) if rests else (0.1, False))


@pytest.mark.parametrize("rested", [False, True])
def test_a_copy_that_rests_while_friction_is_less_than_what_holds_it_slips(rested):
    p, s = records()
    s.V_X, s.off_force = 0.0, 0.0
    # A drive that is held by less than the bound: the copy rests, and all of it is friction.
    u_x, u_y = 0.9 * 0.75 * float(p.f_0) + float(p.stiffness[0]) * s.X, float(p.stiffness[1]) * s.Y
    held = copied_friction(0.9 * 0.75 * float(p.f_0), 0.0, p, s)
    assert held == pytest.approx(0.9 * 0.75 * p.f_0)
    # Off by noise, or less.
    noise = float(np.hypot(p.force_noise, p.stiffness[0] * np.sqrt(s.P[AT_X, AT_X])))
    x = s.X
    follow_force(held - noise, u_x, u_y, rested, p, s)
    assert (s.X, s.V_X) == (x, 0.0)
    moved = []
    for off in (0.04 * float(p.f_0), 0.05 * float(p.f_0)):
        # Measured friction is less by that, in the mean of a period: at its end if the tip starts in it.
        s.X, s.V_X, s.off_force = x, 0.0, 0.0 if rested else off
        follow_force(held - off, u_x, u_y, rested, p, s)
        moved.append((s.X - x, s.V_X))
    # What is beyond noise moves it.
    assert np.subtract(moved[1], moved[0]) == pytest.approx(0.01 * p.f_0 * p.Gamma_hold[0], rel=1e-9)
    assert 0.8 < moved[0][1] / (0.04 * p.f_0 * p.Gamma_hold[0, 1]) < 1.0


@pytest.mark.parametrize(("seed", "first", "periods"), [(0, 0.5, 1.0), (1, 2.0, 3.0), (2, 2.0, 3.0)])
def test_positions_alone_are_enough_at_200_us_with_nothing_known(seed, first, periods):
    noise = {name.replace(".", "__"): value for name, value in NOISE.items()}
    result = run(2e-4, 1, MEASURED, first, periods, **noise, plant__seed=seed)
    # The largest of 600 errors is six times the rms one.
    assert max(result.score.rms[:2]) < 0.009 * 5e-9
    assert error(result.score) < 5.5
    assert smoothness(result) < 2.0
    assert result.score.contact_fraction == 1.0


@pytest.mark.parametrize("known", [{"law.surface": "known"}, NOTHING], ids=["known", "observed"])
def test_the_estimate_is_three_times_better_than_a_position_and_stays_a_covariance(known):
    sim, controller = parameters(2e-4, 1, MEASURED | known, NOISE, 0.5, 1.0)
    ticks = round(PERIOD / 2e-4)
    instrument, law = Instrument(sim, ticks), Controller(controller)
    missed = []
    for tick in range(ticks):
        answer = law.answer(instrument.measurement, tick * 2e-4)
        if tick > ticks // 2:
            missed.append(law.state.estimate[:2] * sim.scales.x0 - instrument.truth.position[:2])
        P = np.array(law.state.P)
        assert P == pytest.approx(P.T, abs=1e-12)
        assert np.linalg.eigvalsh(P)[0] > -1e-9
        instrument.tick(answer)
    assert math.sqrt(np.square(missed).mean()) < 5e-11 / 3.0


@pytest.mark.parametrize("seed", [7, 9])
def test_friction_that_is_not_seen_is_not_believed_to_be_more_than_a_surface_makes_it(seed):
    # Where a Lissajous figure runs along y a speed that was missed was taken for friction: 1.06 of it, and a throw.
    found = law_records.estimates("Lissajous 2:3", 2, "observed", seed)
    assert np.max(found["friction_ratio"][len(found["time"]) // 4 :]) < 1.026


def test_what_is_believed_of_a_scanner_that_stays_as_it_is_does_not_wander():
    # A random walk ten times as wide let the slow force wander by 4e-11 N, and the copy with it.
    found = law_records.estimates("resonances -2 %", 0, "known")
    later = slice(len(found["time"]) // 2, None)
    assert np.std(found["slow_force_x"][later]) < 1e-11
    assert np.max(np.abs(found["stiffness_x"][later] - 1.0)) < 1e-3


def test_friction_is_found_from_below_before_a_tenth_of_a_period_is_over():
    # Told 20 % too little, the law begins at 0.75 of that: the ratio that it has to find is 1.25.
    sim, controller = parameters(2e-4, 1, MEASURED, NOISE, 0.0, 1.0)
    instrument, law = Instrument(sim, 200), Controller(controller)
    ratios = []
    for tick in range(round(0.1 * PERIOD / 2e-4)):
        instrument.tick(law.answer(instrument.measurement, tick * 2e-4))
        ratios.append(float(law.state.ratio[0]))
    assert ratios[0] == pytest.approx(0.75, abs=0.05)
    assert ratios[-1] == pytest.approx(1.25, rel=0.03)
    assert max(ratios) < 1.25 * 1.03
