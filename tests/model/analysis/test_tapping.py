"""Claims about the energy of tapping: that of an oscillator that is integrated, and of the instrument's own contact."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from afm_model import Instrument, build
from afm_model.analysis import beam_energy, tapping_energy
from afm_model.parameters import InstrumentParameters

W0, Q, K = 2.0 * math.pi, 50.0, 1.0
"""Of an oscillator of mass 1 / W0^2, in its own units."""


def integrated(zc: float, w: float, viscous: float) -> tuple[complex, float, float]:
    """Response at frequency w, energy lost in the contact in a cycle, and mean of force times motion, of an oscillator
    that is driven by a force of 0.02 cos w t over a soft wall with a viscosity that grows into it.
    """

    def contact(q: Any, v: Any) -> Any:
        depth = np.maximum(-(zc + q), 0.0)
        return 2.0 * depth**1.5 - viscous * depth * v

    def rate(t: float, y: Any) -> list[float]:
        force = 0.02 * math.cos(w * t) + float(contact(y[0], y[1]))
        return [y[1], W0**2 * (force - K * y[0]) / K - W0 / Q * y[1]]

    period, settled, last, points = 2.0 * math.pi / w, 130, 10, 400
    t = np.linspace(settled * period, (settled + last) * period, last * points + 1)
    found = solve_ivp(rate, (0.0, t[-1]), [0.0, 0.0], method="DOP853", t_eval=t, rtol=1e-8, atol=1e-10)
    q, v = found.y[:, :-1]
    force, at = contact(q, v), np.exp(-1j * w * t[:-1])
    virial = float(np.mean(force * q) - force.mean() * q.mean())
    return complex(2.0 * np.mean(q * at)), float(-np.sum(force * v) * period / points / last), virial


@pytest.mark.parametrize(("zc", "detuned", "viscous"), [(0.8, 1.0, 0.3), (0.7, 0.995, 0.3)])
def test_energy_and_virial_are_those_of_an_integrated_oscillator_within_half_a_percent(zc, detuned, viscous):
    w = W0 * detuned
    response, lost, virial = integrated(zc, w, viscous)
    free = 0.02 / (1.0 - detuned**2 + 1j * detuned / Q)
    found = tapping_energy(response, free, frequency=w, f0=W0, Q=Q, k=K)
    # Higher harmonics carry what is left.
    assert found.dissipated == pytest.approx(lost, rel=5e-3, abs=0.0)
    assert found.virial == pytest.approx(virial, rel=5e-3, abs=0.0)
    assert (lost > 1e-3, virial < 0.0) == (True, True)


class Tapped(NamedTuple):
    """Ten periods of the instrument's tip: by what its photodiode shows, and by its contact's account."""

    energy: Any  # by amplitude and phase, and harmonics
    first: Any  # without harmonics
    lost: float  # by the account, in a period [J]
    driven: float  # by the drive [J]
    virial: float  # of the true force and height, step by step
    read: dict[str, Any]


def tapped(ticks: int = 400, steps: int = 128, modes: int = 1, drive: str = "base", **more: Any) -> Tapped:
    """The instrument's tip taps in its lock-in; more: parameters, with __ for the dot."""
    quality, k, periods = 60.0, 2.8, 10
    dt = 1.0 / (77e3 * steps)
    values = {"plant.kind": "lever", "plant.lever": "ppp_fmr", "plant.f0": 1.0 / (steps * dt), "plant.Q": quality}
    values |= {"plant.modes": modes, "plant.tilt": 0.0, "plant.dt": dt, "plant.contact": "dmt"}
    values |= {"plant.control_period": steps * dt, "plant.scanner": "stack_13um", "sample.kind": "flat"}
    values |= {"detector.sample_period": dt, "onboard.kind": "dynamic", "onboard.feedback": "external"}
    base = 10e-9 / (1.5660 * quality) if drive == "base" else 10e-9 / quality
    values |= {"onboard.drive": drive, "onboard.drive_amplitude": base, "onboard.time_constant": 50e-6}
    lost = [f"truth/lost_by_{what}" for what in ("viscosity", "bridge", "friction")]
    values |= {"detector.channels": ", ".join(["in_phase, quadrature, truth/tip_height, truth/contact", *lost])}
    parameters = build(InstrumentParameters, values | {name.replace("__", "."): value for name, value in more.items()})
    base = parameters.onboard.drive_amplitude
    scope = Instrument(parameters, ticks)
    for _ in range(ticks):
        scope.tick(scope.drive)
    last = scope.take_block().samples[:, -periods * steps - 1 :]
    read = {each.name: each.scale(parameters) * row for each, row in zip(scope.channels, last, strict=True)}
    response = read["in_phase"].mean() - 1j * read["quadrature"].mean()
    # Of docs/dynamic.md (42) and (45), summed here.
    x, kappa, gain = roots(modes)
    r = (x[0] / x) ** 2
    answer = 1.0 / (1.0 - r**2 + 1j * r / quality)
    by_base = np.sum(2.0 / 3.0 * kappa * gain * r**2 * answer)
    by_tip = 1.0 + np.sum(2.0 / 3.0 * 12.0 * kappa / x**4 * (answer - 1.0))
    known = {"frequency": 77e3, "f0": 77e3, "Q": quality, "k": k, "drive": drive, "modes": modes}
    free = base * (by_base if drive == "base" else by_tip)
    seen = 2.0 * np.abs(np.fft.rfft(read["deflection"][1:])) / (periods * steps)
    more = {n: seen[n * periods] for n in range(2, 40)}
    energy = beam_energy(response, free, **known, harmonics=more)
    force, height = read["truth/normal_force"][1:], read["truth/tip_height"]
    middle = 0.5 * (height[1:] + height[:-1])
    return Tapped(
        energy,
        beam_energy(response, free, **known),
        sum(read[name][-1] - read[name][0] for name in lost) / periods,
        math.pi * k * abs(response) ** 2 / quality,
        float(np.mean(force * middle) - force.mean() * middle.mean()),
        read,
    )


def roots(modes: int) -> tuple[Any, Any, Any]:
    """Of a clamped beam: cos x cosh x = -1, slope over deflection at the end, and mean over mean square."""
    x = np.array([brentq(lambda x: math.cos(x) * math.cosh(x) + 1.0, a, a + 2.0) for a in (1.0, 4.0, 7.0)[:modes]])
    ratio = (np.cos(x) + np.cosh(x)) / (np.sin(x) + np.sinh(x))
    end = np.cosh(x) - np.cos(x) - ratio * (np.sinh(x) - np.sin(x))
    slope = x * (np.sinh(x) + np.sin(x) - ratio * (np.cosh(x) - np.cos(x))) / end
    return x, slope, 2.0 * ratio * end / x


SMOOTH = {"plant__tau": 1e-3}
"""Without friction, which would bend the cantilever as well."""
LOSSES = [
    (2, {"plant__gap": 7e-9, "plant__viscosity": 3e3}),
    (3, {"plant__gap": 7e-9, "plant__viscosity": 2e4}),
    (3, {"plant__gap": 7e-9, "plant__viscosity": 1e4, "plant__contact": "maugis"}),
]


@pytest.mark.parametrize(("modes", "values"), LOSSES)
def test_energy_by_amplitude_and_phase_is_what_the_contact_took(modes, values):
    """Of the instrument: from its photodiode, against the account of its contact."""
    found = tapped(steps=512, modes=modes, **SMOOTH, **values)
    assert found.energy.dissipated == pytest.approx(found.lost, rel=5e-3, abs=0.0)
    # The virial by shorter steps, below: the truth of a step that is divided is that of its last part.
    # Harmonics take a good part of the energy into the air.
    assert 1.15 * found.lost < found.first.dissipated
    assert 0.05 * found.driven < found.lost


def test_virial_of_a_contact_that_takes_energy_needs_the_harmonics():
    found = tapped(steps=2048, modes=LOSSES[0][0], **SMOOTH, **LOSSES[0][1])
    assert found.energy.virial == pytest.approx(found.virial, rel=5e-3, abs=0.0)
    assert abs(found.first.virial / found.virial - 1.0) > 1e-2


@pytest.mark.parametrize(
    ("modes", "values"),
    [
        LOSSES[2],
        (2, {"plant__gap": 7e-9, "plant__viscosity": 1e4, "plant__contact": "jkr"}),
        (3, {"plant__gap": 7e-9, "plant__viscosity": 1e4, "plant__contact": "jkr"}),
        (3, {"plant__gap": 20e-9, "plant__bridge_volume": 1e-25, "onboard__drive_amplitude": 3.193e-10}),
        (3, {"plant__gap": 20e-9, "plant__bridge_volume": 1e-26, "onboard__drive_amplitude": 3.193e-10}),
    ],
)
def test_energy_and_virial_of_a_contact_that_takes_energy_with_short_steps(modes, values):
    # A tip that lands at 512 steps a period gains or loses up to some percent; and so does the truth of the virial.
    found = tapped(steps=8192, modes=modes, **SMOOTH, **values)
    assert found.energy.dissipated == pytest.approx(found.lost, rel=5e-3, abs=0.0)
    assert found.energy.virial == pytest.approx(found.virial, rel=5e-3, abs=0.0)
    assert 0.05 * found.driven < found.lost


@pytest.mark.parametrize(
    ("modes", "drive", "contact"), [(1, "base", "dmt"), (2, "base", "jkr"), (3, "base", "maugis"), (3, "tip", "dmt")]
)
def test_attraction_over_the_sample_takes_no_energy_and_its_virial_is_that_of_the_force(modes, drive, contact):
    """Of the instrument: from its photodiode, against the true force and height of its tip."""
    found = tapped(modes=modes, drive=drive, plant__gap=10.2e-9, plant__contact=contact)
    assert found.energy.virial == pytest.approx(found.virial, rel=3e-3, abs=0.0)
    assert found.energy.virial > 0.0
    assert abs(found.energy.dissipated) < 3e-5 * found.driven
    assert (found.read["truth/contact"].any(), found.lost) == (False, 0.0)


def test_what_is_not_known_of_a_beam_is_refused():
    known = {"frequency": 77e3, "f0": 77e3, "Q": 60.0, "k": 2.8}
    for values, told in (
        ({"Q": 0.0}, "Q = 0 is not allowed"),
        ({"modes": 4}, "modes = 4 is not allowed: it must be one of 1 to 3"),
        ({"drive": "torsion"}, "drive = torsion is not allowed: it must be base or tip"),
        ({"harmonics": {1: 1e-9}}, "harmonic 1 is not allowed: it must be >= 2"),
    ):
        with pytest.raises(ValueError, match=told):
            beam_energy(1e-9, 2e-9, **known | values)


def test_at_resonance_it_is_the_formula_of_cleveland():
    A, A0, phi = 6e-9, 10e-9, 1.1
    found = tapping_energy(A * np.exp(-1j * phi), -1j * A0, frequency=3e5, f0=3e5, Q=400.0, k=42.0)
    assert found.dissipated == pytest.approx(math.pi * 42.0 * A / 400.0 * (A0 * math.sin(phi) - A), rel=1e-12, abs=0.0)
    assert found.virial == pytest.approx(-42.0 * A * A0 / 800.0 * math.cos(phi), rel=1e-12, abs=0.0)
    with pytest.raises(ValueError, match="Q = 0 is not allowed: it must be a positive number"):
        tapping_energy(1.0, 1.0, frequency=1.0, f0=1.0, Q=0.0, k=1.0)
