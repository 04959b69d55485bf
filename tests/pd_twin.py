"""The law of examples/pd_controller.py as an object in process: the same numbers in the same order."""

import runpy
from pathlib import Path
from typing import Any

import numpy as np

from afm_model import SimParameters
from afm_model.parts import record_at
from afm_model.parts.signals import Measurement

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "pd_controller.py"


class Twin:
    """Made as `compare` makes an object."""

    def __init__(self, sim: SimParameters) -> None:
        self._gains = runpy.run_path(str(EXAMPLE), run_name="read")["GAINS"].values()

    def answer(self, measurement: Any) -> Any:
        y = record_at(measurement, 0, Measurement)
        positions = (y.position[0], y.position[1], y.deflection)
        drive = np.zeros(3)
        for axis, (gain, damping) in enumerate(self._gains):
            error = y.reference_position[axis] - positions[axis]
            rate = y.reference_velocity[axis] - y.velocity[axis]
            drive[axis] = gain * error + damping * rate
        return drive
