"""Claims about frequency shift and force: closed forms, integrals by mpmath, and the instrument itself."""

import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from afm_model import build
from afm_model.analysis import energy_from_drive, force_from_shift, frequency_shift, tapping_energy
from afm_model.parameters import InstrumentParameters

from ..clamped_mode import clamped_mode
from ..held import held

K, F_0, H, R = 40.0, 300e3, 1e-19, 10e-9
AMPLITUDES = (0.1e-9, 0.3e-9, 1e-9, 3e-9, 10e-9, 50e-9)


def van_der_waals(d: Any) -> Any:
    return -H * R / (6.0 * d**2)


def shift_of_van_der_waals(d: Any, A: float) -> Any:
    """The integral in closed form: f0 / k times - H R / 6 (d (d + 2 A))^(3/2)."""
    return -F_0 * H * R / (6.0 * K * (d * (d + 2.0 * A)) ** 1.5)


A_0, E = 0.2e-9, 10e9


def dmt(d: Any) -> Any:
    """Attraction down to the distance A_0, and from there on a Hertz contact besides."""
    return van_der_waals(np.maximum(d, A_0)) + 4.0 / 3.0 * E * math.sqrt(R) * np.maximum(A_0 - d, 0.0) ** 1.5


@pytest.mark.parametrize("A", AMPLITUDES)
def test_shift_by_van_der_waals_is_the_closed_form(A):
    d = np.geomspace(0.2e-9, 20e-9, 7)
    assert frequency_shift(van_der_waals, d, A, K, F_0) == pytest.approx(shift_of_van_der_waals(d, A), rel=1e-6)


# By mpmath with 30 digits, in parts about the kink: quad(lambda t: dmt(d + A + A cos(t)) cos(t)), 0 to pi.
DMT = (
    (0.1e-9, 0.1e-9, -24147.4646715821),
    (0.1e-9, 0.3e-9, -21734.236059119),
    (0.1e-9, 1e-9, -5253.3340288393),
    (0.1e-9, 3e-9, -1123.31602386328),
    (0.1e-9, 10e-9, -191.444299401462),
    (0.1e-9, 50e-9, -17.3383839102722),
    (0.18e-9, 0.1e-9, -59598.103665549),
    (0.18e-9, 1e-9, -4751.53373507621),
    (0.18e-9, 50e-9, -15.3774356800755),
)


@pytest.mark.parametrize(("d", "A", "expected"), DMT)
def test_shift_by_a_contact_is_the_integral_of_mpmath(d, A, expected):
    assert frequency_shift(dmt, d, A, K, F_0) == pytest.approx(expected, rel=1e-5)


def curve(points: int, seed: int, A: float, furthest: float) -> tuple[np.ndarray, np.ndarray]:
    """Distances in uneven steps, denser near the sample, and the shift there."""
    steps = np.random.default_rng(seed).uniform(0.5, 1.5, points)
    place = np.cumsum(steps) / steps.sum()
    d = 0.3e-9 * (furthest / 0.3e-9) ** place
    return d, shift_of_van_der_waals(d, A)


REACHED = {0.1e-9: 0.035, 0.3e-9: 0.036, 1e-9: 0.03, 3e-9: 0.004, 10e-9: 0.004, 50e-9: 0.005}


@pytest.mark.parametrize("A", AMPLITUDES)
def test_force_from_shift_is_van_der_waals_within_what_is_said(A):
    d, shift = curve(300, 3, A, 60e-9)
    found = force_from_shift(d[::-1], shift[::-1], A, K, F_0)
    force, near = found.force[::-1], d < 3e-9
    assert np.abs(force / van_der_waals(d) - 1.0)[near].max() < REACHED[A]
    # What it says itself covers it, but for what lies beyond the last point.
    assert (np.abs(force - van_der_waals(d)) < 2.0 * found.uncertainty[::-1] + abs(van_der_waals(60e-9)))[near].all()


def test_uncertainty_of_the_force_covers_noise():
    A, noise, inside, random = 1e-9, 0.2, [], np.random.default_rng(5)
    for seed in range(40):
        d, shift = curve(80, seed, A, 60e-9)
        found = force_from_shift(d, shift + noise * random.normal(size=d.size), A, K, F_0, noise=noise)
        allowed = 2.0 * found.uncertainty + abs(van_der_waals(60e-9))
        inside.append((np.abs(found.force - van_der_waals(d)) < allowed)[:-5])
    assert np.mean(inside) > 0.95


def test_shift_that_a_force_makes_is_given_back_where_the_force_was_found():
    d, shift = curve(300, 3, 1e-9, 60e-9)
    found = force_from_shift(d, shift, 1e-9, K, F_0)
    assert found.reproduced == pytest.approx(shift, rel=0.1, abs=1e-3 * np.abs(shift).max())


def test_force_that_swings_with_the_distance_can_leave_no_trace_in_the_shift():
    # First zero of J_1: what the docstring says.
    A = 1e-9
    q = 3.8317059702075125 / A
    ripple = frequency_shift(lambda d: 1e-10 * np.sin(q * d), np.linspace(1e-9, 3e-9, 9), A, K, F_0)
    slower = frequency_shift(lambda d: 1e-10 * np.sin(0.5 * q * d), np.linspace(1e-9, 3e-9, 9), A, K, F_0)
    assert np.abs(ripple).max() < 1e-9 * np.abs(slower).max()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"amplitude": 0.0}, "amplitude = 0 is not allowed: it must be a positive number"),
        ({"k": -1.0}, "k = -1 is not allowed"),
        ({"f0": math.nan}, "f0 = nan is not allowed"),
        ({"distance": np.zeros(30)}, "two points at distance = 0 m"),
        ({"distance": np.arange(3.0)}, "must be two lists of the same length"),
        ({"distance": np.full(30, math.inf)}, "must be finite numbers"),
        ({"shift": np.full(30, -1.0)}, "the shift at the far end is 1 Hz, 100.0% of the largest"),
        ({"noise": -1.0}, "noise not negative"),
    ],
)
def test_curves_of_which_no_force_comes_are_refused_in_a_sentence(change, told):
    d, shift = curve(30, 0, 1e-9, 60e-9)
    given: dict[str, Any] = {"distance": d, "shift": shift, "amplitude": 1e-9, "k": K, "f0": F_0}
    with pytest.raises(ValueError, match=told):
        force_from_shift(**given | change)


def test_forces_that_cannot_be_integrated_are_refused_in_a_sentence():
    with pytest.raises(ValueError, match="a curve of 5 points is not allowed: it must have 10 to 5000"):
        force_from_shift(np.arange(5.0), np.zeros(5), 1e-9, K, F_0)
    with pytest.raises(ValueError, match=r"the force is not finite at a distance of .* m, which the tip reaches"):
        frequency_shift(lambda d: np.where(d > 1e-9, van_der_waals(d), np.nan), 0.5e-9, 1e-9, K, F_0)
    random = np.random.default_rng(0)
    with pytest.raises(ValueError, match="does not settle at distance = 5e-10 m: the force must be one function"):
        frequency_shift(lambda d: random.normal(size=d.shape), 0.5e-9, 1e-9, K, F_0)


def moved(r: float, contact: complex, quality: float, drive: str) -> tuple[complex, complex]:
    """Deflection shown, and motion of the tip, of a cantilever of spring constant 1 under a drive of 1, at r times its
    first resonance: the force on its tip is `contact` times the motion of the tip.
    """
    give, seen, base, seen_base = 1.0 + 0.0j, 1.0 + 0.0j, 1.0 + 0.0j, 0.0j
    for number in range(3):
        mode = clamped_mode(number)
        own, slope, inertia = r / mode.over_first, mode.slope / mode.end, mode.end * mode.mean / mode.mean_square
        answer = 1.0 / (1.0 - own * own + 1j * own / quality)
        give += (answer - 1.0) / mode.stiffness
        seen += 2.0 / 3.0 * slope / mode.stiffness * (answer - 1.0)
        base += inertia * own * own * answer
        seen_base += 2.0 / 3.0 * slope * inertia * own * own * answer
    by_drive, seen_drive = (base, seen_base) if drive == "base" else (give, seen)
    tip = by_drive / (1.0 - give * contact)
    return seen_drive + seen * contact * tip, tip


def in_quadrature(contact: complex, quality: float, drive: str) -> float:
    """Frequency over that of the first resonance at which what is shown is a quarter of a period behind the drive."""
    about = 1.0 - 0.5 * contact.real / 1.0302
    return float(brentq(lambda r: moved(r, contact, quality, drive)[0].real, about - 2e-3, about + 2e-3, xtol=1e-15))


# Of an elastic contact that shifts by up to 2.5 %, and little or much loss for it.
CONTACTS = [complex(elastic, -loss) for elastic in (-0.03, 0.01, 0.05) for loss in (0.02, 1.0)]


@pytest.mark.parametrize("drive", ["base", "tip"])
@pytest.mark.parametrize("quality", [60.0, 165.0, 1000.0])
@pytest.mark.parametrize("contact", CONTACTS)
def test_energy_from_the_drive_is_that_of_a_beam_on_a_contact_in_closed_form(contact, quality, drive):
    contact = complex(contact.real, contact.imag / quality)
    free, f0, k, A = in_quadrature(0j, quality, drive), 77e3, 2.8, 9e-9
    r = in_quadrature(contact, quality, drive)
    (shown, tip), (alone, _) = moved(r, contact, quality, drive), moved(free, 0j, quality, drive)
    b, shift = abs(alone / shown), r - free
    # What the contact takes from a tip that moves by this.
    lost = -math.pi * k * contact.imag * abs(tip / shown * A) ** 2
    found = energy_from_drive(b, shift * f0, A, f0=f0, Q=quality, k=k, drive=drive)
    assert found == pytest.approx(lost, rel=2e-3)
    # docs/dynamic.md (53), of first order in the shift: what is left is of second order.
    end, epsilon = A * 1.0899, 0.374 if drive == "base" else -0.030
    first = b - 1.0 - (1.0 - 2.0 * epsilon * b + 0.245 * (2.0 - b)) * shift
    assert math.pi * 1.0302 * k * end**2 / quality * first == pytest.approx(lost, rel=0.02)


def test_energy_from_the_drive_refuses_what_it_does_not_have():
    with pytest.raises(ValueError, match="drive = torsion is not allowed: it must be base or tip"):
        energy_from_drive(1.1, 0.0, 1e-8, f0=77e3, Q=100.0, k=2.8, drive="torsion")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="amplitude = 0 is not allowed: it must be a positive number"):
        energy_from_drive(1.1, 0.0, 0.0, f0=77e3, Q=100.0, k=2.8)


def test_cantilever_of_the_instrument_shows_the_shift_of_its_own_attraction_at_a_fixed_frequency():
    """From its lock-in, against Giessibl's integral of the law of its attraction."""
    steps, quality = 128, 200.0
    base = 10e-9 / (1.5660 * quality)
    dt = 1.0 / (77e3 * steps)
    values = {"plant.kind": "lever", "plant.lever": "ppp_fmr", "plant.f0": 1.0 / (steps * dt), "plant.Q": quality}
    values |= {"plant.modes": 1, "plant.tilt": 0.0, "plant.contact": "dmt", "plant.dt": dt, "sample.kind": "flat"}
    values |= {"plant.control_period": steps * dt, "plant.scanner": "stack_13um", "detector.sample_period": dt}
    values |= {"onboard.kind": "dynamic", "onboard.feedback": "external", "onboard.time_constant": 50e-6}
    values |= {"onboard.drive_amplitude": base, "detector.channels": "in_phase, quadrature, truth/indentation"}

    def settled(gap: float) -> tuple[complex, float, Any]:
        parameters = build(InstrumentParameters, values | {"plant.gap": gap})
        _, read, _ = held(parameters, 1200)
        last = {name: each[-10 * steps :].mean() for name, each in read.items()}
        return complex(last["in_phase"], -last["quadrature"]) / (2 / 3 * 1.3765), last["truth/indentation"], parameters

    free, _, _ = settled(1e-6)
    for gap in (11.5e-9, 13e-9):
        response, indentation, parameters = settled(gap)
        k, pair = 1.0302 * 2.8, parameters.plant.pair_numbers
        energy = tapping_energy(response, free, frequency=77e3, f0=77e3, Q=quality, k=k, base=base)
        # Of DMT: the attraction is that of the end of the contact, 2 pi w R, at this distance.
        D = math.sqrt(pair.hamaker / (12.0 * math.pi * pair.work_of_adhesion)) - indentation
        A, R_tip = abs(response + base), parameters.plant.cantilever_numbers.tip_radius
        attraction = partial(lambda d, c: -c / d**2, c=pair.hamaker * R_tip / 6.0)
        expected = frequency_shift(attraction, D - A, A, k, 77e3)
        assert -77e3 * energy.virial / (k * A**2) == pytest.approx(float(expected), rel=5e-3)
