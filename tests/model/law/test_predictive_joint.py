"""Claims about the joint filter of position, speed and friction, against matrices and by hand."""

import math

import numpy as np
import pytest

from afm_model import ControllerParameters, build
from afm_model.law.predictive.joint import (
    ACROSS,
    ALONG,
    RATIO,
    SPEED,
    correct_scanner,
    see_ratio,
    spread,
    take_ratio_seen,
    turn_to,
)
from afm_model.law.predictive.kalman import weigh
from afm_model.law.predictive.nominal_plant import look, nominal_bound
from afm_model.law.predictive.predictive_constants import Constants, values
from afm_model.law.predictive.predictive_state import State, start
from afm_model.law.predictive.sample_estimate import VALUE

from ..tables import record_of


def records():
    """Constants and state of the law at 1 ms, the tip slipping along x."""
    told = {"law.kind": "predictive", "law.period": 1e-3, "law.packet": 20, "law.surface": "known"}
    parameters = build(ControllerParameters, told)
    p, s = record_of(Constants, **values(parameters)), record_of(State, **start(parameters))
    s.V_X, s.v[0], s.ratio[VALUE] = 0.1, 0.1, 0.75
    s.weights[RATIO] = 1.0
    return p, s


def covariance(rng):
    """Some covariance."""
    root = rng.normal(size=(4, 4))
    return root @ root.T


def test_the_covariance_is_carried_as_the_free_scanner_and_friction_say(rng):
    p, s = records()
    P, nominal = covariance(rng), 12.0
    s.joint[:] = P
    spread(True, nominal, p, s)
    pushed = np.zeros(4)
    pushed[:2] = -nominal * np.array(p.of_drive)
    F = np.eye(4)
    F[:2, :2] = p.free
    F[:, RATIO] += pushed
    Q = p.uneven**2 * np.outer(pushed, pushed) + np.diag([0.0, 0.0, p.astray**2, p.wander**2])
    assert s.joint == pytest.approx(F @ P @ F.T + Q, rel=1e-12)


def test_of_what_rests_nothing_but_the_ratio_grows_uncertain(rng):
    p, s = records()
    P = covariance(rng)
    s.joint[:], s.V_X = P, 0.0
    spread(False, 12.0, p, s)
    P[SPEED, :] = P[:, SPEED] = 0.0
    P[RATIO, RATIO] += p.wander**2
    assert s.joint == pytest.approx(P, rel=1e-12)


def test_a_measurement_corrects_as_the_kalman_filter_says(rng):
    _, s = records()
    P, H, noise, innovation = covariance(rng), rng.normal(size=4), 0.3, 0.7
    s.joint[:], s.weights[:4] = P, H
    s.heading[:] = 0.6, 0.8
    s.X, s.Y, s.V_X, s.V_Y, ratio = 1.0, 2.0, 0.3, 0.4, s.ratio[VALUE]
    correct_scanner(innovation, weigh(s.joint, s.weights, s.gains) + noise, s)
    gain = P @ H / (H @ P @ H + noise)
    assert s.joint == pytest.approx(P - np.outer(gain, H @ P), rel=1e-9, abs=1e-12)
    change = gain * innovation
    t, n = np.array([0.6, 0.8]), np.array([-0.8, 0.6])
    assert (s.X, s.Y) == pytest.approx(tuple(np.array([1.0, 2.0]) + change[ALONG] * t + change[ACROSS] * n))
    assert (s.V_X, s.V_Y) == pytest.approx(tuple(np.array([0.3, 0.4]) + change[SPEED] * t))
    assert s.ratio[VALUE] == pytest.approx(ratio + change[RATIO])


def test_a_motion_that_turns_takes_its_covariance_with_it(rng):
    _, s = records()
    P = covariance(rng)
    s.joint[:] = P
    for angle in (0.3, 2.0, math.pi):
        turn_to(math.cos(angle), math.sin(angle), s)
    # Half a turn: positions and speed change their signs, but for what a speed across would be.
    sign = np.diag([-1.0, math.cos(0.3) * math.cos(1.7) * math.cos(math.pi - 2.0), -1.0, 1.0])
    assert s.joint == pytest.approx(sign @ P @ sign, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("angle", [0.2, 0.8, -2.5])
def test_the_force_tells_of_the_place_as_differences_of_the_bound_and_of_the_balance_say(angle):
    p, s = records()
    drive = np.array([9.0, 8.0])
    s.load, s.ratio[VALUE] = p.load_0, 1.1

    def bound(place):
        look(place[0], place[1], p, s)
        return nominal_bound(s.load, p, s)

    def seen(place, believed):
        """Ratio seen where the scanner is at `place` and believed to be at `believed`."""
        b, c = drive - p.stiffness[:2] * place, drive - p.stiffness[:2] * believed
        force = 1.1 * bound(place) * b[0] / np.hypot(*b)
        return force / (c[0] / np.hypot(*c) * bound(believed))

    believed = np.array([3.0, 2.0]) + 4.0 * np.array([math.cos(angle), math.sin(angle)])
    balance = drive - p.stiffness[:2] * believed
    size = np.hypot(*balance)
    t = balance / size
    n = np.array([-t[1], t[0]])
    s.X, s.Y, s.heading[:] = believed[0], believed[1], t
    see_ratio(bound(believed), size, p, s)
    for state, way in ((ALONG, t), (ACROSS, n)):
        expected = (seen(believed + 1e-4 * way, believed) - seen(believed - 1e-4 * way, believed)) / 2e-4
        # A forward difference over 0.01 x0.
        assert s.weights[state] == pytest.approx(expected, abs=1e-4)
    assert (s.weights[SPEED], s.weights[RATIO]) == (0.0, 1.0)


def test_friction_that_holds_more_than_is_believed_raises_the_bound_at_once_even_at_rest():
    p, s = records()
    s.V_X = 0.0
    take_ratio_seen(0.9, 1e-7, 0.0, p, s)
    assert s.ratio[VALUE] == pytest.approx(0.9, abs=1e-4)


def test_less_friction_than_is_believed_tells_nothing_at_rest():
    p, s = records()
    s.V_X = 0.0
    before = s.ratio[VALUE], s.joint[RATIO, RATIO]
    take_ratio_seen(0.2, 1e-7, 0.0, p, s)
    assert (s.ratio[VALUE], s.joint[RATIO, RATIO]) == before


def test_less_friction_while_the_tip_slips_lowers_the_bound_no_faster_than_a_surface_does():
    p, s = records()
    take_ratio_seen(0.2, 1e-7, 0.0, p, s)
    assert s.ratio[VALUE] == pytest.approx(0.75 - p.ripple * p.wave_number * 0.1 * p.hold, rel=1e-9)


def test_one_force_that_is_not_as_expected_is_let_pass_and_the_second_is_not():
    p, s = records()
    s.joint[RATIO, RATIO], s.calm = 1e-8, 10.0
    take_ratio_seen(0.8, 1e-7, 0.0, p, s)
    assert s.ratio[VALUE] == 0.75
    take_ratio_seen(0.8, 1e-7, 0.0, p, s)
    assert s.ratio[VALUE] == pytest.approx(0.8, abs=1e-5)
    assert math.sqrt(s.joint[RATIO, RATIO]) == pytest.approx(math.sqrt(1e-7), rel=0.01)
