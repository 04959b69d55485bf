"""Claims about the fit of a resonance: it finds that of a closed form, with uncertainties that cover under noise."""

import math

import numpy as np
import pytest

from afm_model.analysis import resonance_fit

F0, Q = 76.3e3, 180.0
GAIN, OTHER = 2.1e-9 * np.exp(0.4j), (0.3 - 0.2j) * 2.1e-9
"""Of the drive, with what other modes add to it."""


def shaken(f: np.ndarray, f0: float = F0, quality: float = Q) -> np.ndarray:
    """Response of a base that is shaken: the force of inertia grows as the square of the frequency."""
    r = f / f0
    return r**2 * (GAIN / (1.0 - r**2 + 1j * r / quality) + OTHER)


def test_resonance_of_a_closed_form_is_found_wherever_it_is_in_the_sweep():
    for f0, quality in ((F0, Q), (0.98 * F0, 60.0), (1.01 * F0, 900.0)):
        f = np.linspace(0.95 * F0, 1.05 * F0, 101)
        fit = resonance_fit(f, shaken(f, f0, quality))
        assert (fit.f0.value, fit.Q.value) == pytest.approx((f0, quality), rel=1e-9)
        at_f0 = shaken(np.array([f0]), f0, quality)[0]
        assert fit.amplitude.value == pytest.approx(abs(at_f0), rel=1e-9)
        assert fit.phase.value == pytest.approx(-np.angle(at_f0), abs=1e-9)
        assert np.allclose(fit.response, shaken(f, f0, quality), rtol=1e-7)


def test_uncertainties_hold_the_truth_as_often_as_they_say_under_thermal_noise():
    """The noise of a mean is as its density there, that of the oscillator itself and a white floor."""
    random = np.random.default_rng(5)
    f = np.linspace(F0 * (1.0 - 4.0 / Q), F0 * (1.0 + 4.0 / Q), 41)
    clean, x = shaken(f), f / F0
    thermal = 1.0 / np.hypot(1.0 - x**2, x / Q)
    sigma = 0.01 * np.abs(clean).max() * np.hypot(thermal / Q, 0.1)
    at_f0 = shaken(np.array([F0]))[0]
    truth = np.array([F0, Q, abs(at_f0), -np.angle(at_f0)])
    off = []
    for _ in range(400):
        fit = resonance_fit(f, clean + sigma * (random.normal(size=41) + 1j * random.normal(size=41)))
        found = [fit.f0, fit.Q, fit.amplitude, fit.phase]
        off.append([(each.value - true) / each.uncertainty for each, true in zip(found, truth, strict=True)])
    share = (np.abs(off) < 2.0).mean(0)
    # Of 400, 95 % are 380 with a standard deviation of 4.4.
    assert np.all((share > 0.92) & (share < 0.985)), share
    assert np.all(np.std(off, 0) > 0.8)


@pytest.mark.parametrize(
    ("frequency", "response", "told"),
    [
        (np.linspace(7e4, 8e4, 7), np.ones(7), "needs 8 finite points at positive frequencies: there are 7"),
        (np.linspace(7e4, 8e4, 9), np.full(9, np.nan), "needs 8 finite points"),
        (np.linspace(7e4, 8e4, 9), np.zeros(9), "the response is 0 everywhere"),
        (np.linspace(7e4, 8e4, 9), np.ones(8), "must be two lists of the same length"),
        (np.linspace(5e4, 6e4, 30), shaken(np.linspace(5e4, 6e4, 30)), "no resonance found from 50000 to 60000 Hz"),
    ],
)
def test_what_is_no_resonance_is_refused_in_words(frequency, response, told):
    with pytest.raises(ValueError, match=told):
        resonance_fit(frequency, response)


def test_phase_is_a_quarter_of_a_turn_for_a_drive_in_phase():
    f = np.linspace(0.98 * F0, 1.02 * F0, 41)
    r = f / F0
    fit = resonance_fit(f, r**2 / (1.0 - r**2 + 1j * r / Q))
    assert fit.phase.value == pytest.approx(0.5 * math.pi, abs=1e-9)
