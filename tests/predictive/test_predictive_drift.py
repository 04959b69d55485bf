"""The friction-predicting law finds how fast the sample moves: from the map of a line, and from a tip that rests."""

import math

import numpy as np
import pytest
from model.tables import record_of

from afm_model import simulate
from afm_model.parts.signals import Measurement
from afm_model.studies.contender import contender
from afm_model.studies.wrong_models import CASE, RATES, Case, parameters_of
from afm_predictive.constants import MEAN, VALUE
from afm_predictive.drift import carry_drift, find_drift
from afm_predictive.map import NODES, before_stroke, begin_map, weights, write_map
from afm_predictive.nominal_plant import look, move, nominal_bound, take_load
from afm_predictive.sample_estimate import see_drag

from .predictive_records import records

ALONG = math.sqrt(2.0)
"""The line lies along x = y."""


def drifting(rate: float) -> Case:
    """The sample moves so fast along x and y [m/s]."""
    return Case("drifting", {"drift.rate_x": rate, "drift.rate_y": rate})


def run(case, rate, noise, *, periods=6, law="predictive surface=learned"):
    """Estimates at the end; largest error of x and y beside the drift in each period [%]."""
    result = simulate(*parameters_of(case._replace(periods=periods), RATES[rate], contender(law), noise, 0))
    off = result.truth["position"][:, :2] - result.measurements["reference_position"][:, :2]
    off -= np.outer(result.time, [case.true.get("drift.rate_x", 0.0), case.true.get("drift.rate_y", 0.0)])
    errors = [100.0 / 5e-9 * abs(each).max() for each in np.array_split(off, periods)]
    return {name: values[-1] for name, values in result.estimates.items()}, errors


def test_it_is_the_kalman_filter_of_way_and_rate(rng):
    p, s = records(surface="learned")
    s.shift = s.shift_found = 1e-9  # in use
    state, P = np.array([1e-9, 0.0]), np.diag([0.0, p.first_drift**2])
    F = np.array([[1.0, p.hold], [0.0, 1.0]])
    for k in range(300):
        slope, variance = 10.0 * math.cos(0.2 * k), 0.003
        off = slope * 4e-4 * p.hold * k + 0.02 * rng.standard_normal()
        carry_drift(p, s)
        state, P = F @ state, F @ P @ F.T
        P[1, 1] = min(P[1, 1] + 9e-12 * p.hold, p.first_drift**2)
        # What is measured is off the map as it is read, so much moved.
        changed = find_drift(off - slope * s.shift, slope, variance, s)
        row = np.array([slope, 0.0])
        gain = P @ row / (row @ P @ row + variance)
        change = gain * (off - row @ state)
        state, P = state + change, P - np.outer(gain, row @ P)
        assert changed == pytest.approx(change[0], rel=1e-6, abs=1e-12)
    assert [s.shift, s.drift] == pytest.approx(state, rel=1e-6)
    assert [s.of_drift[0, 0], s.of_drift[0, 1], s.of_drift[1, 1]] == pytest.approx(P[[0, 0, 1], [0, 1, 1]], rel=1e-6)
    assert s.drift == pytest.approx(4e-4, rel=0.3)


def test_no_single_height_counts_for_more_than_three_deviations():
    found = []
    for off in (3.0, 30.0):
        p, s = records(surface="learned")
        carry_drift(p, s)
        find_drift(off * math.sqrt(0.3 + 100.0 * s.of_drift[0, 0]), 10.0, 0.3, s)
        found.append(s.shift_found)
    assert found[0] == pytest.approx(found[1]) != 0.0


def test_a_way_is_believed_once_it_is_certain():
    p, s = records(surface="learned")
    for _ in range(100):
        carry_drift(p, s)
        if s.shift != 0.0:
            break
        before = s.shift_found, math.sqrt(s.of_drift[0, 0])
        find_drift(10.0 * 0.5, 10.0, 0.3, s)
    else:
        pytest.fail("it was not believed")
    assert before[0] < 5.0 * before[1]
    assert s.shift == s.shift_found
    assert s.of_drift[1, 1] == 4e-4**2


def test_slope_of_the_map_is_that_of_its_height(rng):
    _, s = records(surface="learned")
    s.map_before[:], s.pitch = rng.standard_normal(NODES), 0.25
    for f in (0.1, 0.5, 0.999):
        height, slope = before_stroke(NODES - 2, f, s)
        assert height == pytest.approx(np.dot(weights(f), s.map_before[[-2, -1, 0, 1]]))
        ends = [before_stroke(NODES - 2, f + step, s)[0] for step in (-1e-4, 1e-4)]
        assert slope == pytest.approx((ends[1] - ends[0]) / 2e-4 / 0.25, rel=1e-6)


def test_a_map_that_has_moved_farther_than_its_ring_reaches_is_begun_anew():
    p, s = records(surface="learned")
    s.pitch, s.line_tx, s.line_ty, s.least, s.most = 0.25, 1.0, 0.0, -30.0, 30.0
    s.shift = s.shift_found = 0.25 * (NODES - 8 - 60) - 0.1
    s.drift = 0.05 / p.hold
    write_map(0.0, 0.0, p, s)
    assert s.shift == s.shift_found > 0.25 * (NODES - 8 - 60) - 0.1
    s.drift = 1.0 / p.hold
    write_map(0.0, 0.0, p, s)
    assert s.shift == s.shift_found == s.drift == 0.0
    assert np.isinf(s.visited).all()


def test_a_map_that_is_begun_anew_has_not_moved():
    p, s = records(surface="learned")
    s.shift, s.shift_found, s.drift, s.of_drift[:] = 1.0, 1.0, 1.0, 1.0
    begin_map(p, s)
    assert [s.shift, s.shift_found, s.drift, s.of_drift[0, 0], s.of_drift[0, 1]] == [0.0] * 5
    assert s.of_drift[1, 1] == p.first_drift**2


@pytest.mark.parametrize(
    ("along_an_axis", "rate", "noise"),
    [(1e-9, 0, 0.0), (1e-9, 1, 0.0), (0.3e-9, 1, 0.0), (1e-9, 0, 1.0), (1e-9, 1, 1.0), (-5e-9, 1, 1.0), (1e-9, 2, 1.0)],
)
def test_rate_of_the_sample_is_found(along_an_axis, rate, noise):
    found, errors = run(drifting(along_an_axis), rate, noise)
    true, deviation = ALONG * along_an_axis, found["drift_deviation"]
    assert found["drift"] == pytest.approx(true, abs=min(2.0 * deviation, max(0.1 * abs(true), 5e-11)))
    assert 0.0 < deviation < 0.3e-9
    # As over a sample that stays: 0.02 to 0.2 % without noise; with noise 0.4, 0.7, 1.5 %.
    assert errors[-1] < (0.3 if noise == 0.0 else 2.0)


def test_what_it_gains():
    # The map lay where the sample had been.
    _, moves = run(drifting(1e-9), 1, 1.0)
    _, stays = run(drifting(1e-9), 1, 1.0, law="predictive surface=learned drift=none")
    assert max(moves[3:]) < 1.5
    assert min(stays[3:]) > 4.0


def test_where_it_is_not_looked_for_there_is_none():
    found, _ = run(drifting(1e-9), 1, 0.0, periods=3, law="predictive surface=learned drift=none")
    assert found["drift"] == found["drift_deviation"] == found["drift_x"] == found["drift_y"] == 0.0
    found, _ = run(drifting(1e-9), 1, 1.0, periods=3, law="predictive surface=observed")
    assert found["drift"] == found["drift_deviation"] == found["drift_x"] == found["drift_y"] == 0.0


def test_until_it_is_seen_nothing_is_known_of_it():
    for noise in (0.0, 1.0):
        found, _ = run(CASE["the truth"], 1, noise, periods=3)
        assert found["drift"] == 0.0
        assert found["drift_deviation"] == pytest.approx(2.5e-9)


# Rates are measured: a tip that rests moves with the sample.


def slow(along_x: float, along_y: float, frequency: float) -> Case:
    """The sample moves so fast [m/s], the reference at so much of the usual frequency."""
    omega = {"reference.omega_x": 50.0 * frequency, "reference.omega_y": 50.0 * frequency}
    return Case("slow", omega | {"drift.rate_x": along_x, "drift.rate_y": along_y})


@pytest.mark.parametrize(
    ("case", "rate", "surface", "most"),
    [
        # It was lost, or stood still, or was thrown by up to 20 times the amplitude.
        (slow(1e-9, 1e-9, 0.2), 0, "observed", 0.2),
        (slow(1e-9, 1e-9, 0.2), 1, "observed", 1.0),
        (slow(-3e-9, -3e-9, 0.2), 1, "known", 2.0),
        (slow(1e-9, 1e-9, 0.05), 1, "observed", 2.0),
        (slow(1e-9, 0.0, 0.2), 1, "observed", 10.0),
        (slow(1e-8, 1e-8, 1.0), 0, "learned", 0.2),
        (slow(1e-8, 1e-8, 1.0), 1, "observed", 1.0),
        (slow(5e-9, 5e-9, 1.0), 2, "known", 20.0),
        (slow(1e-8, 1e-8, 1.0), 2, "observed", 20.0),
    ],
)
def test_a_sample_that_moves_under_a_slow_reference_is_tracked_beside_its_drift(case, rate, surface, most):
    found, errors = run(case, rate, 0.0, periods=3, law=f"predictive surface={surface}")
    assert max(errors[1:]) < most
    assert found["fallbacks"] == 0.0
    expected = [case.true["drift.rate_x"], case.true["drift.rate_y"]]
    assert [found["drift_x"], found["drift_y"]] == pytest.approx(expected, rel=0.02)


def test_what_it_gains_that_a_tip_at_rest_shows_it():
    _, errors = run(slow(1e-9, 1e-9, 0.2), 1, 0.0, periods=3, law="predictive surface=observed drift=none")
    assert max(errors[1:]) > 50.0


@pytest.mark.parametrize(
    ("rate", "held", "seen"),
    [
        ((1e-3, -2e-3), 0.49, True),
        ((1e-3, -2e-3), 0.51, False),
        ((0.0099, 0.0), 0.1, True),
        ((0.0101, 0.0), 0.1, False),
    ],
)
def test_only_a_tip_that_friction_holds_for_certain_tells_it(rate, held, seen):
    p, s = records(surface="observed")
    s.X, s.Y, (s.V_X, s.V_Y), s.ratio[[VALUE, MEAN]] = 1.0, 0.5, rate, 0.8
    y = record_of(Measurement, deflection=0.0)
    take_load(y, p, s)
    look(s.X, s.Y, p, s)
    f = s.here * nominal_bound(s.load, p, s)
    y.drive[:2] = (p.stiffness[:2] * [1.0, 0.5] + held * f * np.array([0.6, -0.8])) * p.volts[:2]
    see_drag(0, y, p, s)
    assert list(s.drag) == (list(rate) if seen else [0.0, 0.0])


def test_a_tip_that_stands_still_tells_that_the_sample_does():
    p, s = records(surface="observed")
    s.ratio[[VALUE, MEAN]], s.drag[:], s.V_X = 0.8, 1e-3, 3e-5
    see_drag(0, record_of(Measurement), p, s)
    assert list(s.drag) == [0.0, 0.0]


@pytest.mark.parametrize(("k", "off", "seen"), [(5, 0.9, True), (5, 1.1, False), (6, 0.0, False)])
def test_once_a_tip_has_slipped_it_has_to_go_steadily(k, off, seen):
    # In the air, where nothing holds it, it does not.
    p, s = records(surface="observed")
    s.ratio[[VALUE, MEAN]], s.slips, s.last = 0.8, 1.0, 4
    s.V_X, s.X = 1e-3, p.hold * (1e-3 + off * 4e-5)
    see_drag(k, record_of(Measurement), p, s)
    assert list(s.drag) == ([1e-3, 0.0] if seen else [0.0, 0.0])


def test_prediction_is_that_of_one_who_moves_with_the_sample():
    # With a sample that moves at a constant rate friction is as before for one who moves with it; the springs are not.
    ends = []
    for drag in (np.zeros(2), np.array([0.02, -0.01])):
        p, s = records(surface="observed")
        s.ratio[[VALUE, MEAN]], s.drag[:] = 1.0, drag
        s.V_X, s.V_Y = np.array([0.3, 0.1]) + drag
        p.stiffness[:2] = p.damping[:2] = 0.0
        move(1.0, -2.0, 0.0, 0.05, 40, p, s)
        ends.append([s.X - 2.0 * drag[0], s.Y - 2.0 * drag[1], s.V_X - drag[0], s.V_Y - drag[1]])
    assert ends[0] == pytest.approx(ends[1], rel=1e-9, abs=1e-12)


def test_a_tip_that_friction_holds_moves_with_the_sample():
    p, s = records(surface="observed")
    s.ratio[[VALUE, MEAN]], s.drag[:] = 1.0, (0.01, 0.0)
    move(0.0, 0.0, 0.0, 0.05, 40, p, s)
    assert [s.V_X, s.V_Y] == [0.01, 0.0]
    assert s.X == pytest.approx(0.02, rel=0.05)
