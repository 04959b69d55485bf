"""The friction-predicting law finds how fast the sample moves along a line that it learns."""

import math
from importlib import import_module

import numpy as np
import pytest

from afm_model import simulate
from afm_model.law.predictive.drift import carry_drift, find_drift
from afm_model.law.predictive.map import NODES, before_stroke, begin_map, weights, write_map
from afm_model.studies.contender import contender
from afm_model.studies.wrong_models import CASE, RATES, Case, parameters_of

from .predictive_records import records

ALONG = math.sqrt(2.0)
"""The line lies along x = y."""


def drifting(rate: float) -> Case:
    """The sample moves so fast along x and y [m/s]."""
    return Case("drifting", {"drift.rate_x": rate, "drift.rate_y": rate})


@pytest.fixture
def run(monkeypatch):
    def of(case, rate, noise, *, periods=6, law="predictive surface=learned"):
        """Estimates at the end; largest error of x and y beside the drift in each period [%]."""
        monkeypatch.setattr(import_module("afm_model.studies.wrong_models"), "_PERIODS", periods)
        result = simulate(*parameters_of(case, RATES[rate], contender(law), noise, 0))
        off = result.truth["position"][:, :2] - result.measurements["reference_position"][:, :2]
        off -= np.outer(result.time, [case.true.get("drift.rate_x", 0.0), case.true.get("drift.rate_y", 0.0)])
        errors = [100.0 / 5e-9 * abs(each).max() for each in np.array_split(off, periods)]
        return {name: values[-1] for name, values in result.estimates.items()}, errors

    return of


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
def test_rate_of_the_sample_is_found(run, along_an_axis, rate, noise):
    found, errors = run(drifting(along_an_axis), rate, noise)
    true, deviation = ALONG * along_an_axis, found["drift_deviation"]
    assert found["drift"] == pytest.approx(true, abs=min(2.0 * deviation, max(0.1 * abs(true), 5e-11)))
    assert 0.0 < deviation < 0.3e-9
    # As over a sample that stays: 0.02 to 0.2 % without noise; with noise 0.4, 0.7, 1.5 %.
    assert errors[-1] < (0.3 if noise == 0.0 else 2.0)


def test_what_it_gains(run):
    # The map lay where the sample had been.
    _, moves = run(drifting(1e-9), 1, 1.0)
    _, stays = run(drifting(1e-9), 1, 1.0, law="predictive surface=learned drift=none")
    assert max(moves[3:]) < 1.5
    assert min(stays[3:]) > 4.0


@pytest.mark.parametrize("law", ["predictive surface=learned drift=none", "predictive surface=observed"])
def test_where_it_is_not_looked_for_there_is_none(run, law):
    found, _ = run(drifting(1e-9), 1, 0.0, periods=3, law=law)
    assert found["drift"] == found["drift_deviation"] == 0.0


def test_until_it_is_seen_nothing_is_known_of_it(run):
    for noise in (0.0, 1.0):
        found, _ = run(CASE["the truth"], 1, noise, periods=3)
        assert found["drift"] == 0.0
        assert found["drift_deviation"] == pytest.approx(2.5e-9)
