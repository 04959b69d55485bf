"""Claims about what the friction-predicting law learns of y from the direction in which the tip slides, in packets."""

import math

import numpy as np
import pytest

from afm_model import load_scenario, simulate
from afm_model.parameters import changed
from afm_model.studies.contender import contender
from afm_model.studies.wrong_models import CASE, RATES, run_case
from afm_predictive.unexplained import learn_across

from .law_records import records

PACKETS = {"period": 1e-3, "packet": 20, "surface": "known"}
GAIN_X, GAIN_Y = 1.04, 0.97
FRICTION, SPEED = 17.0, 0.14


def believes(gain_x, gain_y):
    """Constants and state of the law, sure of x."""
    p, s = records(**PACKETS)
    s.fastest = SPEED
    for axis, gain in enumerate((gain_x, gain_y)):
        s.gain_of[axis] = s.learned[axis, 0] = gain
    s.unsure[0] = 1e-12 * np.eye(len(s.unsure[0]))
    return p, s


def slides(p, s, angle, push, speed=SPEED):
    """Let it learn from a tip that slides in a direction, driven on by a push along it: friction of both axes and drive
    are those of a scanner with the true gains.
    """
    t = np.array([math.cos(angle), math.sin(angle)])
    q, eta2, damping = np.array([s.X, s.Y]), np.array(p.stiffness[:2]), np.array(p.damping[:2])
    s.V_X, s.V_Y = speed * t
    u = eta2 * q + damping * speed * t + np.array([GAIN_X, GAIN_Y]) * FRICTION * t + push * t
    learn_across(FRICTION * t[0], u[0], u[1], p, s)


def test_gain_of_y_is_found_from_that_of_x_whatever_drives_the_tip_along(rng):
    p, s = believes(GAIN_X, GAIN_X)
    for _ in range(40):
        s.X, s.Y = rng.uniform(-20.0, 20.0, 2)
        slides(p, s, rng.choice([0.0, math.pi]) + rng.uniform(0.4, 1.1), rng.uniform(-8.0, 8.0))
    assert s.gain_of[1] == pytest.approx(GAIN_Y, rel=1e-3)
    # Nothing else was wrong: what is pushed by a hundredth of friction at most.
    assert abs(s.slow[1]) < 0.01 * FRICTION and abs(20.0 * s.softer[1]) < 0.01 * FRICTION
    assert s.gain_of[0] == GAIN_X


def test_a_direction_that_was_expected_is_not_learned_from():
    p, s = believes(GAIN_X, GAIN_Y + 0.005)
    slides(p, s, math.pi / 4.0, 3.0)
    assert s.knows_y == 0.0 and s.gain_of[1] == GAIN_Y + 0.005


@pytest.mark.parametrize(("angle", "speed"), [(1.4, SPEED), (math.pi / 4.0, 0.1 * SPEED)], ids=["along y", "slow"])
def test_motion_along_y_and_a_tip_that_nearly_rests_tell_nothing(angle, speed):
    p, s = believes(GAIN_X, GAIN_X)
    slides(p, s, angle, 0.0, speed)
    assert s.knows_y == 0.0 and s.gain_of[1] == GAIN_X


@pytest.mark.parametrize(("surface", "most"), [("known", 1.0), ("learned", 2.0)])
def test_packets_bear_a_resonance_of_one_axis_that_is_told_wrong(surface, most):
    case = CASE["resonance of x +2 %"]
    row = run_case(case, RATES[2], contender(f"predictive surface={surface}"))
    assert row["worst"] < most and not row["lost"]


@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_measured_under_an_older_answer_teaches_nothing(seed):
    # The drives of two packets differ little in sum, and each by more than what is learned: it cost 2 to 6 %.
    scenario = load_scenario("realtime_1ms")
    late = {"kind": "jitter", "signal": "drive", "size": 1.03e-3, "seed": seed, "start": 0.05}
    late = {"fault.kind": "scheduled", **{f"fault.late.{name}": value for name, value in late.items()}}
    run = simulate(changed(scenario.sim, {"run.mode": "lockstep", "run.duration": 2.0, **late}), scenario.controller)
    off = np.abs(run.truth["position"][:, :2] - run.measurements["reference_position"][:, :2]) / 5e-11
    assert off[run.time > 0.26].max() < 0.2
