"""Claims about AmplitudeCurve: it is the curve of the forces of the sample, in closed form, in both directions."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from afm_model.microscope import AmplitudeCurve, Local, Withdraw

from .test_tune import driven

GAP, DRIVE, Q, GAIN, SHOWN = 50e-9, 1.1e-10, 60.0, 1.5660, 2.0 / 3.0 * 1.3765
CURVE = AmplitudeCurve(begin=34e-9, ramp=10e-9, rate=1e-6, settle=5e-3, points=100)


def tapping(**values: float | str) -> Local:
    lever = {"plant__lever": "ppp_fmr", "plant__Q": Q, "plant__dt": 1e-7, "plant__modes": 1, "plant__tilt": 0.0}
    more = {"plant__gap": GAP, "plant__contact": "dmt", "onboard__time_constant": 50e-6}
    return driven(**lever | more | {"onboard__drive_amplitude": DRIVE} | values)


def distance(amplitude: float) -> float:
    """Of the undeflected tip at which the van der Waals force alone leaves this amplitude [m], at resonance: it takes
    no energy, and so is in phase with the motion of the tip, of deflection and base. Periodic motion, all harmonics.
    """
    H, R, k, w = 1e-19, 10e-9, 2.8, 0.1
    free, mode = GAIN * Q * DRIVE, 1.0302 * k

    def answer(phi: float) -> tuple[complex, complex]:
        """Motion of the tip, and the force that makes this deflection of the free one."""
        q = amplitude * np.exp(-1j * phi)
        return q + DRIVE, mode * 1j / Q * (q + 1j * free)

    guess = math.pi - math.asin(amplitude / free)
    phi = brentq(lambda phi: np.imag(np.divide(*answer(phi)[::-1])), guess - 0.1, min(guess + 0.1, math.pi), xtol=1e-12)
    motion, needed = answer(phi)
    moved = abs(motion)
    beyond = math.sqrt(H / (12.0 * math.pi * w))  # distance at which it is the pull-off force 2 pi w R

    number, rest = np.arange(2049), 1.0 / k - 1.0 / mode

    def harmonics(mean: float) -> np.ndarray:
        """Of the force over a cycle; those from the second on, and the higher modes, move the tip as well."""
        own, total = moved * np.cos(np.linspace(0.0, 2.0 * math.pi, 4096, endpoint=False)), np.zeros(2049)
        gives = np.where(number < 2, 0.0, 1.0 / (mode * (1.0 - np.maximum(number, 2) ** 2))) + rest * (number > 0)
        for _ in range(30):
            place = mean + own + np.fft.irfft(gives * total) * 4096
            total = np.fft.rfft(-H * R / 6.0 / (place + beyond) ** 2).real / 4096
        return total

    mean = brentq(lambda zc: 2.0 * harmonics(zc)[1] - np.real(needed / motion) * moved, moved, moved + 8e-9, xtol=1e-14)
    return mean - harmonics(mean)[0] / k


def test_amplitude_over_distance_is_that_of_the_attraction_in_closed_form():
    microscope = tapping()
    z0 = microscope.instrument.orders.onboard.z
    outcome = microscope.execute(CURVE)
    assert (outcome.status, outcome.message) == ("complete", "")
    found = {name: each.values for name, each in outcome.result.variables.items()}
    assert found["amplitude"].shape == (2, 100)
    zc = GAP - (found["z"] - z0)
    amplitude = found["amplitude"] / SHOWN
    free = GAIN * Q * DRIVE
    assert amplitude[:, 0] == pytest.approx(free, rel=2e-3)
    for share in (0.95, 0.9, 0.8, 0.7):
        # Lock-in and cantilever are late by some tenth of a nanometre, there and back alike.
        places = [np.interp(share * free, a[::-1], d[::-1]) for a, d in zip(amplitude, zc, strict=True)]
        assert np.mean(places) == pytest.approx(distance(share * free), abs=0.03e-9)
        assert 0.0 < places[1] - places[0] < 0.7e-9
    # The phase goes beyond a quarter of a turn: the branch of attraction.
    assert found["phase"][:, -1].min() > 2.0
    assert microscope.instrument.orders.onboard.z == pytest.approx(z0, abs=1e-15)
    assert not microscope.state.near


@pytest.mark.parametrize("share", [0.9, 0.7])
def test_it_ends_where_the_amplitude_has_fallen_to_a_share_and_both_ways_are_at_the_same_places(share):
    microscope = tapping()
    lag = 4.0 * 50e-6 + Q / (math.pi * 77e3)
    rate = 2e-7
    outcome = microscope.execute(CURVE.model_copy(update={"rate": rate, "points": 333, "end_share": share}))
    assert (outcome.status, outcome.message) == ("complete", "")
    found = {name: each.values for name, each in outcome.result.variables.items()}
    free = GAIN * Q * DRIVE
    whole = np.isfinite(found["z"]).all(0).sum()
    assert whole < 333
    # The mean before the one in which it fell to that, and no further one but that.
    last = found["amplitude"][0, whole - 1] / SHOWN
    assert share * free < last < share * free + 0.05e-9
    assert found["z"].shape[1] <= whole + 1
    # They are 30 pm apart, and z is read a sample late.
    assert np.ptp(found["z"][:, :whole], axis=0).max() < 2e-12
    # Where the sample leaves this share, and what z does within the lag.
    zc = GAP - (found["z"][0, whole - 1] - (microscope.instrument.orders.onboard.z))
    assert zc == pytest.approx(distance(share * free) - rate * lag, abs=0.1e-9)
    assert microscope.instrument.orders.program.offset == pytest.approx(0.0, abs=1e-15)


def test_it_ends_at_ramp_where_the_amplitude_does_not_fall_so_far():
    outcome = tapping().execute(CURVE.model_copy(update={"ramp": 1e-9, "end_share": 0.5}))
    assert (outcome.status, outcome.message) == ("complete", "")
    z = outcome.result.variables["z"].values
    assert (z.shape, np.isnan(z).any()) == ((2, 100), False)


def test_with_loops_of_phase_and_amplitude_it_is_a_curve_of_frequency_shift_and_drive():
    A = GAIN * Q * DRIVE
    loops = {"onboard__phase_bandwidth": 300.0, "onboard__amplitude_bandwidth": 300.0}
    loops |= {"onboard__kind": "frequency_modulation", "onboard__amplitude_setpoint": A * SHOWN}
    microscope = tapping(**loops)
    z0 = microscope.instrument.orders.onboard.z
    outcome = microscope.execute(CURVE.model_copy(update={"ramp": 4e-9, "rate": 2e-7}))
    assert (outcome.status, outcome.message) == ("complete", "")
    found = outcome.result.variables
    shift, drive = found["frequency_shift"], found["drive_amplitude"]
    assert (shift.attributes["units"], drive.attributes["units"]) == ("Hz", "m")
    beyond = math.sqrt(1e-19 / (12.0 * math.pi * 0.1))
    zc = GAP - (found["z"].values - z0) + beyond
    angle = (np.arange(100_000) + 0.5) * math.pi / 100_000

    def giessibl(distance: float) -> float:
        force = -1e-19 * 10e-9 / 6.0 / (distance + A * np.cos(angle)) ** 2
        return float(-77e3 / (1.0302 * 2.8 * A) * np.mean(force * np.cos(angle)))

    # Loops and lock-in are late by a tenth of a nanometre, there and back alike.
    expected = giessibl(zc[:, -20].mean()) - giessibl(zc[:, 0].mean())
    assert (shift.values[:, -20] - shift.values[:, 0]).mean() == pytest.approx(expected, rel=1e-2, abs=0.0)
    # Attraction takes nothing: the drive stays.
    assert drive.values[:, -20] == pytest.approx(drive.values[:, 0], rel=2e-3)


@pytest.mark.parametrize(
    ("values", "verb", "told"),
    [
        ({"onboard__drive_amplitude": 0.0}, CURVE, "onboard.drive_amplitude = 0: it must be > 0 m; tune sets it"),
        ({}, CURVE.model_copy(update={"ramp": 1e-3}), "ramp = 0.001 m is not allowed here: z has "),
        ({}, CURVE.model_copy(update={"points": 100_000}), "points = 100000 is not allowed: there are 5000 samples"),
        (
            {"onboard__lock_in": "lateral"},
            CURVE.model_copy(update={"end_share": 0.5}),
            "end_share = 0.5 is not allowed with onboard.lock_in = lateral: take deflection",
        ),
        ({}, CURVE, ""),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(values, verb, told):
    sentence = tapping(**values).objection(verb)
    assert told in sentence
    assert bool(told) == bool(sentence)


def test_curve_that_is_cancelled_brings_back_what_there_is_with_the_tip_off_the_sample():
    microscope = tapping()
    microscope.operator.begin(CURVE)
    for _ in range(2):
        microscope.step()
    microscope.operator.cancel()
    while microscope.operator.busy:
        microscope.step()
    outcome = microscope.operator.outcome()
    assert outcome.status == "cancelled"
    z = outcome.result.variables["z"].values
    assert (z.shape, np.isnan(z).all(1).tolist()) == ((2, 100), [False, True])
    assert (microscope.state.near, microscope.instrument.in_contact) == (False, False)
    assert microscope.objection(Withdraw()) == ""
