"""Claims about pid, implicit, super_twisting and observer in the loop: what they reach, and by which formula."""

import math

import numpy as np
import pytest

from afm_model import ControllerParameters, SimParameters, build
from afm_model.core.registry import find
from afm_model.law import observer
from afm_model.law.pid import simc, tustin
from afm_model.law.scanner import free_axes, place_poles
from afm_model.law.super_twisting import K_1, K_2, sliding_row
from afm_model.parts.signals import Measurement
from afm_model.run.simulation import run
from afm_model.studies.linear import at_timing, linearise

from .loops import closed_loop

LAWS = ("pid", "implicit", "super_twisting", "observer")
FRICTION = 12.7 * 15e-9
"""Of the flat sample at the setpoint [N]."""


# Largest error and rms [% of the amplitude] in docs/laws.md, and how many periods of delay; a tenth more is a change.
@pytest.mark.parametrize(
    ("kind", "period", "delay", "largest", "rms"),
    [
        ("pid", 2e-6, 0, 0.045, 0.0022),
        ("pid", 5e-5, 0, 27.0, 6.4),
        ("implicit", 2e-6, 0, 0.032, 0.031),
        ("implicit", 5e-5, 0, 19.5, 17.8),
        ("super_twisting", 5e-5, 0, 1.9, 0.22),
        ("super_twisting", 5e-5, 1, 16.2, 3.3),
        ("observer", 5e-5, 0, 2.2, 0.26),
        ("observer", 2e-5, 1, 0.52, 0.2),
    ],
)
def test_law_tracks_as_well_as_the_docs_say(kind, period, delay, largest, rms):
    figures = closed_loop(kind, period, delay)
    assert figures.largest <= largest and figures.rms <= rms
    assert figures.contact == 1.0


def test_friction_that_is_known_is_worth_a_factor_of_fifty_to_the_implicit_law():
    unknown, known = closed_loop("implicit", 5e-5), closed_loop("implicit", 5e-5, friction=FRICTION)
    assert known.largest < unknown.largest / 40.0
    assert known.largest < 0.4


def test_error_of_the_implicit_law_is_that_of_its_formula():
    # docs/laws.md (4.2): along x alone, the load of one axis is all of friction.
    figures = closed_loop("implicit", 2e-5, sim={"reference.amplitude_y": 0.0})
    hold, friction = 0.2, 12.75
    bound = hold**2 * friction / -math.expm1(-1.0) / 20.0 * 100.0
    assert 0.9 * bound < figures.rms < figures.largest < 1.1 * bound


@pytest.mark.parametrize("kind", ["implicit", "super_twisting", "observer"])
def test_law_without_delay_does_not_chatter(kind):
    law, paper = closed_loop(kind, 5e-5), closed_loop("sgn", 5e-5)
    assert law.variation < paper.variation / 1000.0


def test_pid_neglects_nothing_that_it_feeds_forward_without_friction():
    # A contact that hardly rubs: the scanner inverted along the reference is all that is needed.
    free = {"contact.tau": 1e3}
    assert closed_loop("pid", 5e-5, sim=free).largest < 0.01
    assert closed_loop("pid", 5e-5, sim=free, feedforward=False).largest > 0.1


def test_pid_along_z_is_worse_than_the_loop_that_all_share():
    shared, own = closed_loop("pid", 5e-5), closed_loop("pid", 5e-5, z="pid")
    assert own.contact == shared.contact == 1.0
    assert shared.z_rms < own.z_rms < 1e-9


def test_pid_comes_out_of_the_limit_of_the_piezo_without_a_long_overshoot():
    # A limit that cuts off the drive's peaks; without anti-windup the sum would go on for all of that time.
    cut = closed_loop("pid", 5e-6, sim={"piezo.limit": 1.6})
    assert cut.largest < 100.0
    free = closed_loop("pid", 5e-6)
    assert cut.largest > 10.0 * free.largest


def test_loop_along_z_holds_the_tip_at_every_rate_and_hardly_any_damping():
    assert closed_loop("observer", 2e-6).z_rms < 0.1e-9
    assert closed_loop("observer", 5e-5).z_rms < 0.15e-9
    assert closed_loop("observer", 2e-4).z_rms < 1.5e-9
    lightly = closed_loop("super_twisting", 5e-5, sim={"contact.zeta_n": 0.01})
    assert lightly.contact == 1.0 and lightly.z_rms < 0.5e-9


@pytest.mark.parametrize(("told", "least", "most"), [(1e-6, 0.0, 1e-12), (0.0, 1e-9, 1e-7)])
def test_weight_of_the_cantilever_is_fed_forward_along_z(told, least, most):
    # On a flat sample with the reference at rest nothing else moves the tip from its setpoint.
    given = {"cantilever.W": 1e-6, "sample.beta": 0.0, "reference.amplitude_x": 0.0, "reference.amplitude_y": 0.0}
    given |= {"run.duration": 0.05, "score.start": 0.025}
    controller = build(ControllerParameters, {"law.kind": "observer", "cantilever.W": told})
    score = run(*at_timing(build(SimParameters, given), controller, 5e-5, 0), hashed=False).score()
    assert score.contact_fraction == 1.0
    assert least <= score.rms[2] <= most


def test_bound_of_friction_is_learned_from_the_load_along_the_motion():
    p, s = (np.zeros(1, kind.dtype).view(np.recarray)[0] for kind in (observer.Constants, observer.State))
    y = np.zeros(1, Measurement.dtype).view(np.recarray)[0]
    p.length[:], p.w0, p.gain = 1.0, 1.0, 0.25
    y.reference_velocity[:2] = y.velocity[:2] = s.before_2[:2] = 1.2, 1.6
    s.load[:2], s.bound = (1.0, -1.0), 2.0
    # Along (0.6, 0.8): 0.6 (3 - 1) + 0.8 (5 + 1) - 2 = 4, of which a quarter is learned.
    assert observer.learn(y, p, s, 3.0, 5.0)
    assert s.bound == pytest.approx(3.0)
    # A scanner that stands tells only that the bound is not below the load.
    y.velocity[:2] = 0.0
    assert not observer.learn(y, p, s, 3.0, 5.0)
    assert s.bound == pytest.approx(6.0)
    assert not observer.learn(y, p, s, 0.0, 0.0)
    assert s.bound == pytest.approx(6.0)


@pytest.mark.parametrize("kind", LAWS)
def test_law_says_what_it_knows(kind):
    assert "deflection" in find("law", kind).knowledge


@pytest.mark.parametrize("delay", [1, 3, 6])
def test_prediction_leaves_a_delayed_loop_no_pole_slower_than_the_free_scanner(delay):
    # Where the reference rests friction adds no damping: docs/laws.md (7.1).
    at_rest = build(SimParameters, {"reference.amplitude_x": 0.0, "reference.amplitude_y": 0.0})
    sim, controller = at_timing(at_rest, build(ControllerParameters, {"law.kind": "observer"}), 2e-5, delay)
    slowest = max(math.exp(-axis.xi * axis.eta * axis.hold) for axis in free_axes(controller))
    assert linearise(sim, controller).radius == pytest.approx(slowest, rel=1e-6)


def test_paper_laws_along_x_and_y_are_the_same_with_the_other_loop_along_z():
    # At 2 us both loops along z hold the tip: the error of tanh along x and y is its own.
    tanh, tracking = closed_loop("tanh", 2e-6), closed_loop("tanh_tracking", 2e-6)
    assert tracking.largest == pytest.approx(tanh.largest, rel=0.01)
    assert tracking.z_rms < tanh.z_rms / 5.0


# Formulae.


def test_simc_rules_are_those_of_the_docs_on_either_side_of_the_resonance():
    fast = simc(0.42, 0.04, hold=0.1, delay=0.1)
    closed = 2.0 * 0.2
    assert fast.gain == pytest.approx(1.0 / (4.0 * closed**2))
    assert fast.reset == pytest.approx(0.1 / (4.0 * closed))
    slow = simc(0.42, 0.04, hold=2.0, delay=2.0)
    closed = 2.0 * 4.0
    assert slow.gain == pytest.approx(0.42 / closed)
    assert slow.reset == pytest.approx(2.0 * 0.42)
    # Tustin's rule has the value of the continuous filter at a frequency that is a little lower.
    z = np.exp(2j * math.atan(0.5 * 2.0 * 0.42))
    digital = (slow.b_0 + slow.b_1 / z + slow.b_2 / z**2) / (1.0 + slow.a_1 / z + slow.a_2 / z**2)
    notch = 2.0 * 0.04 * 0.42**2 * 1j / ((1.0 * 0.42j + 1.0) * (0.42j + 0.42)) / 0.42
    assert digital == pytest.approx(notch)


def test_tustin_keeps_the_static_gain_and_maps_a_pole_as_it_should():
    b_0, b_1, b_2, a_1, a_2 = tustin([0.0, 0.0, 3.0], [0.0, 2.0, 1.0], hold=1.0)
    assert (b_0 + b_1 + b_2) / (1.0 + a_1 + a_2) == pytest.approx(3.0)
    assert sorted(np.roots([1.0, a_1, a_2])) == pytest.approx([-1.0, 0.6])  # (1 - 1/4) / (1 + 1/4); s^2 has no share


def test_sliding_variable_vanishes_in_one_step_and_takes_the_period_per_drive():
    parameters = build(ControllerParameters, {"law.kind": "super_twisting", "law.period": 5e-5})
    for axis in free_axes(parameters)[:2]:
        K = place_poles(axis, 0.0, 0.4)
        C = np.array(sliding_row(axis, K))
        assert C @ axis.gamma == pytest.approx(axis.hold)
        np.testing.assert_allclose(C @ (axis.phi - np.outer(axis.gamma, K)), 0.0, atol=1e-12)


def test_gains_of_super_twisting_meet_the_condition_of_moreno_and_osorio():
    # k_2 above the bound of the rate, and a Hurwitz matrix of their quadratic form.
    assert K_2 > 1.0
    assert np.all(np.linalg.eigvals([[-0.5 * K_1, 0.5], [-K_2, 0.0]]).real < 0.0)
