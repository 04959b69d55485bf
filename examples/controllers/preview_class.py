"""A controller that looks ahead, and the same one that does not: of use where a reference turns round.

From one control tick to the next the drive carries the free scanner along the reference, friction added along its way.
"""

import math
from typing import Any

import numpy as np

from afm_model import SimParameters, preview_reference
from afm_model.parts import record_at
from afm_model.parts.signals import Measurement


class Feedforward:
    """Drive from the reference when it comes into force and one period on, each position and velocity (2,), SI."""

    def __init__(self, sim: SimParameters) -> None:
        self.period, self.delay = sim.plant.control_period, sim.plant.delay_ticks
        tau = 4.0 * (1 + self.delay) * self.period
        scanner, piezo = sim.scanner, sim.piezo
        self.w = 2.0 * math.pi * np.array([scanner.f_x, scanner.f_y])
        self.damping = 2.0 * np.array([scanner.xi_x, scanner.xi_y]) * self.w
        self.volts = 1.0 / (self.w**2 * np.array([piezo.sensitivity_x, piezo.sensitivity_y]))
        self.kp, self.kd = 1.0 / tau**2, 2.0 / tau
        self.mass, self.bound = scanner.mass_ratio * sim.cantilever.m_c, 0.0

    def drive(self, error: Any, rate: Any, lateral_force: float, now: Any, then: Any, z: float) -> Any:
        """Drive [V], (3,), for an error and its rate (2,) and the force along x that was measured; along z as it is."""
        (r, v), (r_then, v_then) = now, then
        mean = (r_then - r) / self.period
        speed = math.sqrt(mean[0] ** 2 + mean[1] ** 2)
        way = mean / speed if speed > 0.0 else np.zeros(2)
        # The bound of friction is what it was when the tip slid last.
        along = lateral_force / self.mass / way[0] if abs(way[0]) > 0.1 else 0.0
        self.bound = max(along, (1.0 - 6.0 * self.period) * self.bound)
        asked = (v_then - v) / self.period + self.damping * mean + self.w**2 * 0.5 * (r + r_then)
        return np.append((asked + self.bound * way + self.kp * error + self.kd * rate) * self.volts, z)


class Ahead:
    """It knows the reference of the run before it begins."""

    knowledge = "positions, velocities, lateral force; scanner, piezo; a preview of the reference"

    def __init__(self, sim: SimParameters) -> None:
        self.law, self.k = Feedforward(sim), 0
        self.preview = preview_reference(sim, 0, sim.total_ticks + self.law.delay + 2)

    def answer(self, measurement: Any) -> Any:
        """Drive [V], (3,), for a measurement."""
        y, (_, r, v, _) = record_at(measurement, 0, Measurement), self.preview
        now, then = ((r[k, :2], v[k, :2]) for k in (self.k + self.law.delay, self.k + self.law.delay + 1))
        error, rate = r[self.k, :2] - y.position[:2], v[self.k, :2] - y.velocity[:2]
        self.k += 1
        return self.law.drive(error, rate, y.lateral_force, now, then, y.drive[2])


class Blind:
    """It continues the reference by its velocity and acceleration."""

    knowledge = "positions, velocities, lateral force; scanner, piezo"

    def __init__(self, sim: SimParameters) -> None:
        self.law = Feedforward(sim)

    def answer(self, measurement: Any) -> Any:
        """Drive [V], (3,), for a measurement."""
        y = record_at(measurement, 0, Measurement)
        r, v, a = y.reference_position[:2], y.reference_velocity[:2], y.reference_acceleration[:2]
        times = (n * self.law.period for n in (self.law.delay, self.law.delay + 1))
        now, then = ((r + t * v + 0.5 * t * t * a, v + t * a) for t in times)
        return self.law.drive(r - y.position[:2], v - y.velocity[:2], y.lateral_force, now, then, y.drive[2])
