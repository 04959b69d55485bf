"""Claims about ContactResonance: stiffness and losses that it finds are those of the contact, written out again."""

import math
from typing import Any

import numpy as np
import pytest

from afm_model.analysis import contact_stiffness
from afm_model.microscope import Approach, ContactResonance, Local, Withdraw

from ..clamped_mode import clamped_mode
from .test_tune import driven

F0, STIFF, Q, LENGTH, ARM = 77e3, 2.8, 80.0, 225e-6, 12.5e-6 + 1.5e-6
K, G, R, WORK, LOAD = 4.5e9, 1.0e9, 10e-9, 0.04, 20e-9
SWEEP: dict[str, Any] = {"points": 16, "average": 2e-4}


def pressed(load: float = LOAD, **values: float | str) -> Local:
    """With a tip that slides freely, upright, on the sample."""
    lever = {"plant__lever": "ppp_fmr", "plant__Q": Q, "plant__modes": 3, "plant__tilt": 0.0, "plant__dt": 5e-8}
    sample = {"plant__contact": "dmt", "plant__K": K, "plant__G": G, "plant__work_of_adhesion": WORK, "plant__tau": 1.0}
    more = {"detector__sample_period": 5e-7, "onboard__time_constant": 50e-6, "onboard__setpoint_force": load}
    drive = {"onboard__drive_amplitude": 2e-13, "plant__gap": 10e-9}
    microscope = driven(**lever | sample | more | drive | values)
    assert microscope.execute(Approach(rate=5e-6, settle=4e-3)).status == "complete"
    return microscope


def found(microscope: Local, **fields: Any) -> dict[str, Any]:
    outcome = microscope.execute(ContactResonance(**SWEEP | fields))
    assert (outcome.status, outcome.message) == ("complete", "")
    return dict(outcome.result.attributes)


def radius(load: float) -> float:
    """Of a DMT contact."""
    return math.cbrt(R * (load + 2.0 * math.pi * WORK * R) / K)


def expected(springs: np.ndarray, dashpots: np.ndarray, count: int = 3, mode: int = 1) -> tuple[float, float]:
    """A resonance [Hz] without damping and its Q: `count` modes of the beam, springs and dashpots at its end, (2, 2)
    between deflection and length times slope.
    """
    modes = [clamped_mode(number) for number in range(count)]
    w = 2.0 * math.pi * F0 * np.array([m.over_first for m in modes])
    inverse = w**2 * 12.0 / (STIFF * np.array([m.wave_number for m in modes]) ** 4)  # of the mass of a mode
    end = np.array([[1.0, m.slope / m.end] for m in modes])
    rest = np.array([[1.0, 1.5], [1.5, 3.0]]) / STIFF - end.T @ np.diag(inverse / w**2) @ end
    # What follows without delay, in series with springs that are much stiffer than the dashpots.
    left = np.linalg.inv(np.eye(2) + springs @ rest)
    springs, dashpots = left @ springs, left @ dashpots @ left.T
    stiffness = np.diag(w**2) + inverse[:, None] * (end @ springs @ end.T)
    losses = np.diag(w / Q) + inverse[:, None] * (end @ dashpots @ end.T)
    zero = np.zeros((count, count))
    roots = np.linalg.eigvals(np.block([[zero, np.eye(count)], [-stiffness, -losses]]))
    root = sorted((root for root in roots if root.imag > 0.0), key=lambda root: root.imag)[mode - 1]
    return abs(root) / (2.0 * math.pi), -0.5 * abs(root) / root.real


def at_end(along: np.ndarray, tilt: float) -> np.ndarray:
    """Of springs (2, 2) between the tip's ways y along the sample and z across it."""
    turn = np.array([[math.sin(tilt), math.cos(tilt) * ARM / LENGTH], [math.cos(tilt), -math.sin(tilt) * ARM / LENGTH]])
    return turn.T @ along @ turn


ACROSS = np.array([[0.0, 0.0], [0.0, 1.0]])


@pytest.mark.parametrize(
    ("over_k", "percents"),
    [
        (3, (0.8, 0.01, 0.0, 0.2, 0.01)),
        (10, (7.5, 0.1, 0.01, 0.7, 0.04)),
        (30, (None, 0.5, 0.03, 3.5, 0.2)),
        (100, (None, 2.1, 0.1, 51.0, 1.3)),
        (300, (None, 7.0, 0.5, None, 5.4)),
    ],
)
def test_what_few_modes_make_of_the_stiffness_is_what_the_page_says(over_k, percents):
    for (modes, mode), percent in zip([(1, 1), (2, 1), (3, 1), (2, 2), (3, 2)], percents, strict=True):
        if percent is not None:
            f, _ = expected(at_end(over_k * STIFF * ACROSS, 0.0), 0.0 * ACROSS, modes, mode)
            told = contact_stiffness(f, f0=F0, k=STIFF, mode=mode).value
            assert 100.0 * (told / (over_k * STIFF) - 1.0) == pytest.approx(percent, rel=2e-3, abs=0.06)


def test_a_larger_drive_makes_the_contact_softer_by_what_the_page_says():
    small, large = (
        found(pressed(plant__modes=2, onboard__drive_amplitude=drive), frequency=211e3) for drive in (2e-13, 1e-12)
    )
    softer = 1.0 - large["contact_stiffness_N_m"] / small["contact_stiffness_N_m"]
    assert softer == pytest.approx(7e-4, abs=2e-4)


@pytest.mark.parametrize(("load", "tilt"), [(10e-9, 0.0), (20e-9, 0.2)])
def test_stiffness_of_a_tip_that_slides_is_that_of_the_contact_and_the_losses_are_those_of_the_cantilever(load, tilt):
    truth = 1.5 * K * radius(load)
    f, quality = expected(at_end(truth * ACROSS, tilt), 0.0 * ACROSS)
    told = found(pressed(load, plant__tilt=tilt), frequency=round(f, -3))
    assert told["contact_stiffness_N_m"] == pytest.approx(truth, rel=2e-3)
    assert told["resonance_Hz"] == pytest.approx(f, rel=4e-4)
    assert told["Q"] == pytest.approx(quality, rel=1.5e-2)
    assert 0.0 < told["contact_stiffness_N_m_uncertainty"] < 1e-3 * truth


def test_viscosity_of_the_contact_is_in_the_quality_factor():
    a, viscosity = radius(LOAD), 20.0
    f, quality = expected(at_end(1.5 * K * a * ACROSS, 0.0), at_end(viscosity * a * ACROSS, 0.0))
    _, without = expected(at_end(1.5 * K * a * ACROSS, 0.0), 0.0 * ACROSS)
    told = found(pressed(plant__viscosity=viscosity), frequency=round(f, -3))
    assert told["Q"] == pytest.approx(quality, rel=1.5e-2)
    assert quality < 0.8 * without
    assert told["contact_stiffness_N_m"] == pytest.approx(1.5 * K * a, rel=2e-3)


@pytest.mark.parametrize(("tilt", "allowed"), [(0.0, 2.5e-3), (0.2, 4e-2)])
def test_tip_that_sticks_has_a_lateral_spring_and_one_that_is_pulled_sideways_another_stiffness(tilt, allowed):
    microscope = pressed(plant__tau=3e8, plant__tilt=tilt)
    ratio = 16.0 * G / (3.0 * K)  # 8 G a over 1.5 K a
    told = found(microscope, frequency=213e3, lateral=ratio)
    s = microscope.instrument._layout.record(microscope.instrument._block, "plant_state")
    truth, pull = 1.5 * K * s.a, s.T_y
    assert s.stuck == 1.0
    assert told["contact_stiffness_N_m"] == pytest.approx(truth, rel=allowed)
    # As the tip goes down by dz the lateral spring grows with the radius, and with it the pull: by pull dz / 2 indent.
    springs = np.array([[ratio * truth, pull * R / (2.0 * s.a**2)], [0.0, truth]])
    f, _ = expected(at_end(springs, tilt), 0.0 * ACROSS)
    assert told["resonance_Hz"] == pytest.approx(f, rel=6e-4)


def test_resonance_is_searched_for_where_no_frequency_is_given():
    microscope = pressed(plant__Q=40.0, plant__modes=2)
    part = microscope.instrument.parameters.onboard
    told = found(microscope, highest=225e3)
    assert told["contact_stiffness_N_m"] == pytest.approx(1.5 * K * radius(LOAD), rel=4e-3)
    assert microscope.instrument.parameters.onboard == part
    assert microscope.state.approached


def test_search_that_ends_before_the_resonance_fails_in_words_and_withdraws_the_tip():
    microscope = pressed(plant__Q=20.0, plant__modes=2)
    outcome = microscope.execute(ContactResonance(**SWEEP, highest=120e3))
    assert outcome.status == "failed"
    assert "no resonance from 77000 to 120000 Hz: the response is largest at 120000 Hz; take another" in outcome.message
    assert not microscope.state.approached


def test_sweep_that_is_cancelled_puts_the_drive_back():
    microscope = pressed(plant__modes=2)
    part = microscope.instrument.parameters.onboard
    microscope.operator.begin(ContactResonance(**SWEEP, frequency=211e3, drive_amplitude=1e-12))
    microscope.step()
    assert microscope.instrument.parameters.onboard.drive_amplitude == 1e-12
    microscope.operator.cancel()
    while microscope.operator.busy:
        microscope.step()
    assert (microscope.operator.outcome().status, microscope.operator.outcome().result) == ("cancelled", None)
    assert microscope.instrument.parameters.onboard == part


@pytest.mark.parametrize(
    ("values", "fields", "told"),
    [
        ({}, {}, "plant.dt = 5e-08 s is not allowed with a drive of 355162 Hz, which it does not resolve"),
        ({}, {"frequency": 211e3, "span": 5e5}, "span = 500000 Hz is not allowed: it must be > 0 and < 422000 Hz"),
        ({}, {"highest": 70e3}, "highest = 70000 Hz is not allowed: it must be > 77000 Hz, the free resonance"),
        ({"onboard__drive": "lateral"}, {}, "onboard.drive = lateral: it must be base or tip"),
        ({"onboard__harmonic": 2}, {}, "onboard.harmonic = 2: it must be 1"),
        ({"onboard__lock_in": "lateral"}, {}, "onboard.lock_in = lateral: it must be deflection"),
        ({"onboard__drive_amplitude": 0.0}, {}, "drive_amplitude = 0 m is not allowed where onboard.drive_amplitude"),
        ({}, {"frequency": 211e3}, ""),
    ],
)
def test_what_cannot_be_swept_is_refused_in_a_sentence(values, fields, told):
    sentence = pressed(plant__modes=2, **values).objection(ContactResonance(**fields))
    assert told in sentence
    assert bool(told) == bool(sentence)


def test_tip_that_is_withdrawn_has_no_contact_resonance():
    microscope = pressed(plant__modes=2)
    assert microscope.execute(Withdraw()).status == "complete"
    assert "while the tip is withdrawn: it must be approached first" in microscope.objection(ContactResonance())
