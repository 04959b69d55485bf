"""The same controller as an object with `answer(measurement)`, for whatever Python can do; some microseconds a tick."""

import math
from typing import Any

import numpy as np

from afm_model import SimParameters
from afm_model.parts import record_at
from afm_model.parts.signals import Measurement


class Pd:
    """Made anew for every run, with what it is told of the instrument."""

    knowledge = "positions and velocities of the scanner; its resonances"

    def __init__(self, sim: SimParameters) -> None:
        tau = 4.0 * (1 + sim.plant.delay_ticks) * sim.plant.control_period
        w = 2.0 * math.pi * np.array([sim.scanner.f_x, sim.scanner.f_y])
        volts = 1.0 / (w**2 * np.array([sim.piezo.sensitivity_x, sim.piezo.sensitivity_y]))
        self.kp, self.kd = volts / tau**2, 2.0 * volts / tau

    def answer(self, measurement: Any) -> Any:
        """Drive [V], (3,), for a measurement."""
        y = record_at(measurement, 0, Measurement)
        error = y.reference_position[:2] - y.position[:2]
        rate = y.reference_velocity[:2] - y.velocity[:2]
        return np.append(self.kp * error + self.kd * rate, y.drive[2])
