"""Constants of the compiled loop itself, of the parameters of an instrument."""

from typing import Any

from ..parameters import InstrumentParameters


def fill_loop(c: Any, parameters: InstrumentParameters) -> None:
    """Write them into a record of `block.LoopState`."""
    plant, detector, piezo = parameters.plant, parameters.detector, parameters.piezo
    c.substeps = plant.substeps
    c.stride = round(detector.sample_period / plant.dt)
    dac_period = piezo.dac_period or plant.control_period
    c.update = round(dac_period / plant.dt)
    c.dac_period = dac_period
    c.delay = plant.delay_ticks
    c.score_tick = parameters.score_tick
    c.control_period = plant.control_period
    c.period_ns = plant.control_period * 1e9
    c.sample_period = detector.sample_period
    c.drive_lsb = 2.0 * piezo.limit / 2**piezo.dac_bits if piezo.dac_bits > 0 else 0.0
    c.drive_limit = piezo.limit
    c.slew_step = piezo.slew_limit * dac_period
    c.deflection_sensitivity = detector.deflection_sensitivity
    c.lateral_sensitivity = detector.lateral_sensitivity
