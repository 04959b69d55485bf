"""Claims about the joint filter of position, speed and friction, against matrices and by hand."""

import math

import numpy as np
import pytest

from afm_model import ControllerParameters, build
from afm_model.law.predictive.constants import CONSTANTS, values
from afm_model.law.predictive.estimate import VALUE
from afm_model.law.predictive.joint import (
    ACROSS,
    ALONG_X,
    ALONG_Y,
    CALM,
    RR,
    SR,
    SS,
    SV,
    VR,
    VV,
    correct,
    spread,
    take_ratio_seen,
    turn_to,
)
from afm_model.law.predictive.state import STATE, start

from ..tables import record_of


def records():
    """Constants and state of the law at 1 ms, the tip slipping along x."""
    told = {"law.kind": "predictive", "law.period": 1e-3, "law.packet": 20, "law.surface": "known"}
    parameters = build(ControllerParameters, told)
    p, s = record_of(CONSTANTS, **values(parameters)), record_of(STATE, **start(parameters))
    s.V_X, s.v[0] = 0.1, 0.1
    return p, s


def matrix(s):
    """Covariance of position, speed and ratio."""
    c = s.joint
    return np.array([[c[SS], c[SV], c[SR]], [c[SV], c[VV], c[VR]], [c[SR], c[VR], c[RR]]])


def fill(s, P):
    """Put a covariance into the state."""
    s.joint[[SS, SV, SR, VV, VR, RR]] = P[0, 0], P[0, 1], P[0, 2], P[1, 1], P[1, 2], P[2, 2]


def covariance(rng):
    """Some covariance."""
    root = rng.normal(size=(3, 3))
    return root @ root.T


def test_the_covariance_is_carried_as_matrices_say(rng):
    p, s = records()
    P, nominal = covariance(rng), 12.0
    fill(s, P)
    spread(True, nominal, p, s)
    pushed = -nominal * np.array(p.of_drive)
    F = np.eye(3)
    F[:2, :2], F[:2, 2] = p.free, pushed
    Q = np.zeros((3, 3))
    Q[:2, :2], Q[2, 2] = p.uneven**2 * np.outer(pushed, pushed), p.wander**2
    assert matrix(s) == pytest.approx(F @ P @ F.T + Q, rel=1e-12)


def test_of_what_rests_nothing_but_the_ratio_grows_uncertain(rng):
    p, s = records()
    P = covariance(rng)
    fill(s, P)
    s.V_X = 0.0
    spread(False, 12.0, p, s)
    expected = P.copy()
    expected[1, :] = expected[:, 1] = 0.0
    expected[2, 2] += p.wander**2
    assert matrix(s) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("measured", "row"), [(SS, [1.0, 0.0, 0.0]), (RR, [0.0, 0.0, 1.0])])
def test_a_measurement_corrects_as_matrices_say(measured, row, rng):
    _, s = records()
    P, H, noise = covariance(rng), np.array(row), 0.3
    fill(s, P)
    change = correct(measured, 0.7, noise, s)
    gain = P @ H / (H @ P @ H + noise)
    assert change == pytest.approx(0.7 * gain, rel=1e-12)
    assert matrix(s) == pytest.approx(P - np.outer(gain, H @ P), rel=1e-9, abs=1e-12)


def test_a_motion_that_turns_back_keeps_what_is_known_and_changes_the_sign(rng):
    _, s = records()
    P = covariance(rng)
    fill(s, P)
    s.joint[ACROSS] = 0.2
    turn_to(-1.0, 0.0, s)
    sign = np.diag([-1.0, -1.0, 1.0])
    assert matrix(s) == pytest.approx(sign @ P @ sign, rel=1e-12)
    assert s.joint[ACROSS] == pytest.approx(0.2)


def test_a_motion_that_turns_by_a_right_angle_exchanges_along_and_across():
    _, s = records()
    s.joint[[SS, ACROSS]] = 0.5, 0.1
    turn_to(0.0, 1.0, s)
    assert (s.joint[SS], s.joint[ACROSS]) == pytest.approx((0.1, 0.5))
    assert (s.joint[ALONG_X], s.joint[ALONG_Y]) == (0.0, 1.0)


def test_friction_that_holds_more_than_is_believed_raises_the_bound_at_once_even_at_rest():
    p, s = records()
    s.V_X = 0.0
    take_ratio_seen(0.9, 1e-7, 0.0, p, s)
    assert s.ratio[VALUE] == pytest.approx(0.9, abs=1e-4)


def test_less_friction_than_is_believed_tells_nothing_at_rest():
    p, s = records()
    s.V_X = 0.0
    before = s.ratio[VALUE], s.joint[RR]
    take_ratio_seen(0.2, 1e-7, 0.0, p, s)
    assert (s.ratio[VALUE], s.joint[RR]) == before


def test_less_friction_while_the_tip_slips_lowers_the_bound_no_faster_than_a_surface_does():
    p, s = records()
    take_ratio_seen(0.2, 1e-7, 0.0, p, s)
    assert s.ratio[VALUE] == pytest.approx(0.75 - p.ripple * p.wave_number * 0.1 * p.hold, rel=1e-9)


def test_one_force_that_is_not_as_expected_is_let_pass_and_the_second_is_not():
    p, s = records()
    s.joint[RR], s.joint[CALM] = 1e-8, 10.0
    take_ratio_seen(0.8, 1e-7, 0.0, p, s)
    assert s.ratio[VALUE] == 0.75
    take_ratio_seen(0.8, 1e-7, 0.0, p, s)
    assert s.ratio[VALUE] == pytest.approx(0.8, abs=1e-5)
    assert math.sqrt(s.joint[RR]) == pytest.approx(math.sqrt(1e-7), rel=0.01)
