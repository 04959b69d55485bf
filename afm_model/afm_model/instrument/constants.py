"""What the tick kernel needs beside the plant: units, reference, detector, drive, as one record in SI."""

import math

import numpy as np
from numpy.typing import NDArray

from ..parameters import InstrumentParameters
from ..plant import Z_COMPUTED, Z_HELD, Z_UNIFORM
from ..reference import SHAPES

COMPLIANT, PAPER = range(2)
_TREATMENTS = {"computed": Z_COMPUTED, "held": Z_HELD, "uniform": Z_UNIFORM}

FIELDS = (
    "plant",
    "treatment",
    "substeps",
    "stride",
    "shape_x",
    "shape_y",
    "score_tick",
    "x0",
    "z0",
    "lateral_speed",
    "vertical_speed",
    "lateral_force",
    "normal_force",
    "control_period",
    "amplitude_x",
    "amplitude_y",
    "omega_x",
    "omega_y",
    "z_r",
    "a",
    "deflection_sensitivity",
    "lateral_sensitivity",
    "noise",
    "adc_lsb",
    "adc_limit",
    "position_noise",
    "gain_x",
    "gain_y",
    "gain_z",
    "drive_lsb",
    "drive_limit",
)
RECORD = np.dtype((np.record, [(name, np.float64) for name in FIELDS]))
"""See `afm_model.plant.constants.RECORD`."""


def instrument_constants(parameters: InstrumentParameters) -> NDArray[np.float64]:
    """Constants in the order of `FIELDS` for `afm_model.instrument.tick`."""
    plant, reference, detector = parameters.plant, parameters.reference, parameters.detector
    scales, scanner, piezo = parameters.scales, parameters.scanner, parameters.piezo
    w0, x0, z0 = scales.w0, scales.x0, scales.z0
    m_c = parameters.cantilever.m_c
    adc_on = detector.adc_bits > 0

    def gain(f: float, sensitivity: float, length: float) -> float:
        """U per volt: a static displacement of one sensitivity."""
        return (2.0 * math.pi * f / w0) ** 2 * sensitivity / length

    values = {
        "plant": COMPLIANT if plant.kind == "compliant" else PAPER,
        "treatment": _TREATMENTS[plant.z],
        "substeps": plant.substeps,
        "stride": round(detector.sample_period / plant.dt),
        "shape_x": SHAPES[reference.shape_x],
        "shape_y": SHAPES[reference.shape_y],
        # Round-off in start / period must not move the first scored tick.
        "score_tick": math.ceil(parameters.score_start / plant.control_period - 1e-6),
        "x0": x0,
        "z0": z0,
        "lateral_speed": x0 * w0,
        "vertical_speed": z0 * w0,
        "lateral_force": scanner.mu * m_c * w0**2 * x0,
        "normal_force": m_c * w0**2 * z0,
        "control_period": plant.control_period,
        "amplitude_x": reference.amplitude_x,
        "amplitude_y": reference.amplitude_y,
        "omega_x": reference.omega_x,
        "omega_y": reference.omega_y,
        "z_r": reference.z_r,
        "a": parameters.cantilever.a,
        "deflection_sensitivity": detector.deflection_sensitivity,
        "lateral_sensitivity": detector.lateral_sensitivity,
        "noise": detector.noise,
        "adc_lsb": 2.0 * detector.adc_limit / 2**detector.adc_bits if adc_on else 0.0,
        "adc_limit": detector.adc_limit if adc_on else 0.0,
        "position_noise": detector.position_noise,
        "gain_x": gain(scanner.f_x, piezo.sensitivity_x, x0),
        "gain_y": gain(scanner.f_y, piezo.sensitivity_y, x0),
        "gain_z": gain(scanner.f_z, piezo.sensitivity_z, z0),
        "drive_lsb": 2.0 * piezo.limit / 2**piezo.dac_bits if piezo.dac_bits > 0 else 0.0,
        "drive_limit": piezo.limit,
    }
    return np.array([float(values[name]) for name in FIELDS])
