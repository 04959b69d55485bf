"""Whole runs of the plant `lever`, each preset in turn: time of a step, simulated over wall time on one core."""

import time
from typing import Any

from afm_model import Controller, ControllerParameters, Instrument, InstrumentParameters, build
from afm_model.plant.presets import LEVERS, PAIRS, SCANNERS

BASE = {"plant.kind": "lever", "sample.kind": "flat", "reference.z_r": 50e-9, "reference.amplitude_y": 0.0}
ROUGH = {"sample.kind": "rough", "sample.size": 400e-9, "sample.pixels": 64, "sample.shortest": 40e-9}
MOVING = {"plant.torsion": "moving", "plant.dt": 5e-7}
ATOMS = {"sample.kind": "lattice", "sample.barrier": 6.4e-20, "plant.apex_stiffness": 1.5}
WARM = ATOMS | {"plant.apex_mass": 4e-11, "plant.apex_damping": 1e6, "plant.temperature": 295.0}
TICKS = 200
"""In a stretch, 4 ms; the lower quartile of many counts: most of them slide, and a busy machine spoils some."""


def measure(stretches: int = 60) -> dict[str, Any]:
    """Of each case by name: `ns_per_step` and `real_time_factor`, law, ADC and score included."""
    cases = {name: {"plant.lever": name} for name in LEVERS}
    cases |= {f"ppp_lfmr, {name}": {"plant.scanner": name} for name in SCANNERS}
    cases |= {f"ppp_lfmr, {name}": {"plant.pair": name} for name in PAIRS}
    cases |= {"ppp_lfmr, rough": ROUGH, "ppp_lfmr, pi": {"onboard.kind": "pi"}}
    cases |= {"ppp_lfmr, 295 K": {"plant.temperature": 295.0}, "ppp_lfmr, torsion at 0.5 us": MOVING}
    cases |= {"ppp_lfmr, lattice": ATOMS, "ppp_lfmr, lattice at 295 K": WARM}
    return {name: _case(BASE | values, stretches) for name, values in cases.items()}


def _case(values: dict[str, Any], stretches: int) -> dict[str, float]:
    parameters = build(InstrumentParameters, values)
    controller = Controller(build(ControllerParameters, {"law.kind": "open_loop"}))
    instrument = Instrument(parameters, TICKS)
    took = []
    for _ in range(stretches):
        begin = time.perf_counter()
        instrument.close_loop(controller, TICKS)
        took.append((time.perf_counter() - begin) / TICKS)
        instrument.skip_block()
    usual = sorted(took)[stretches // 4]
    period = parameters.plant.control_period
    return {"ns_per_step": usual / parameters.plant.substeps * 1e9, "real_time_factor": period / usual}
