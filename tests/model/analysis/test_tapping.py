"""Claims about the energy of tapping: that of an oscillator that is integrated, and of the instrument's own contact."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from afm_model import Instrument, build
from afm_model.analysis import tapping_energy
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


def tapped(ticks: int = 500, **more: Any) -> tuple[Any, dict[str, Any], float, float]:
    """The instrument's tip taps in its lock-in: energy by amplitude and phase, the last ten periods of its true force
    and height, step by step, and energy of the drive in a period and mean of force times motion in these.
    """
    steps, quality, gain = 128, 60.0, 1.5660
    dt = 1.0 / (77e3 * steps)
    base = 10e-9 / (gain * quality)
    values = {"plant.kind": "lever", "plant.lever": "ppp_fmr", "plant.f0": 1.0 / (steps * dt), "plant.Q": quality}
    values |= {"plant.modes": 1, "plant.tilt": 0.0, "plant.dt": dt}
    values |= {"plant.control_period": steps * dt, "plant.scanner": "stack_13um", "sample.kind": "flat"}
    values |= {"detector.sample_period": dt, "onboard.kind": "dynamic", "onboard.feedback": "external"}
    values |= {"onboard.drive_amplitude": base, "onboard.time_constant": 50e-6}
    lost = [f"truth/lost_by_{what}" for what in ("viscosity", "bridge", "friction")]
    values |= {"detector.channels": ", ".join(["in_phase, quadrature, truth/tip_height, truth/contact", *lost])}
    parameters = build(InstrumentParameters, values | {name.replace("__", "."): value for name, value in more.items()})
    scope = Instrument(parameters, ticks)
    for _ in range(ticks):
        scope.tick(scope.drive)
    last = scope.take_block().samples[:, -10 * steps - 1 :]
    read = {each.name: each.scale(parameters) * row for each, row in zip(scope.channels, last, strict=True)}
    force, height = read["truth/normal_force"][1:], read["truth/tip_height"]
    middle = 0.5 * (height[1:] + height[:-1])
    response = (read["in_phase"].mean() - 1j * read["quadrature"].mean()) / (2.0 / 3.0 * 1.3765)
    found = tapping_energy(
        response, -1j * gain * quality * base, frequency=77e3, f0=77e3, Q=quality, k=1.0302 * 2.8, base=base
    )
    driven = math.pi * 1.0302 * 2.8 * abs(response) ** 2 / quality
    return found, read, driven, float(np.mean(force * middle) - force.mean() * middle.mean())


@pytest.mark.parametrize("contact", ["dmt", "jkr", "maugis"])
def test_attraction_over_the_sample_takes_no_energy_and_its_virial_is_that_of_the_force(contact):
    """Of the instrument: from its lock-in, against the true force and height of its tip."""
    found, read, driven, virial = tapped(plant__gap=10.2e-9, plant__contact=contact)
    assert found.virial == pytest.approx(virial, rel=5e-3, abs=0.0)
    assert found.virial > 0.0
    assert abs(found.dissipated) < 1e-3 * driven
    work = np.sum(read["truth/normal_force"][1:] * np.diff(read["truth/tip_height"]))
    assert abs(work / 10) < 1e-3 * driven
    assert not read["truth/contact"].any()


def test_at_resonance_it_is_the_formula_of_cleveland():
    A, A0, phi = 6e-9, 10e-9, 1.1
    found = tapping_energy(A * np.exp(-1j * phi), -1j * A0, frequency=3e5, f0=3e5, Q=400.0, k=42.0)
    assert found.dissipated == pytest.approx(math.pi * 42.0 * A / 400.0 * (A0 * math.sin(phi) - A), rel=1e-12, abs=0.0)
    assert found.virial == pytest.approx(-42.0 * A * A0 / 800.0 * math.cos(phi), rel=1e-12, abs=0.0)
    with pytest.raises(ValueError, match="Q = 0 is not allowed: it must be a positive number"):
        tapping_energy(1.0, 1.0, frequency=1.0, f0=1.0, Q=0.0, k=1.0)
