"""Whole runs of the plant `lever`, each preset in turn: processor time of a step, simulated time over it."""

import time
from typing import Any

from afm_model import Controller, ControllerParameters, Instrument, InstrumentParameters, build
from afm_model.microscope import Microscope
from afm_model.plant.presets import LEVERS, PAIRS, SCANNERS

BASE = {"plant.kind": "lever", "sample.kind": "flat", "reference.z_r": 50e-9, "reference.amplitude_y": 0.0}
ROUGH = {"sample.kind": "rough", "sample.size": 400e-9, "sample.pixels": 64, "sample.shortest": 40e-9}
MOVING = {"plant.torsion": "moving", "plant.dt": 5e-7}
ATOMS = {"sample.kind": "lattice", "sample.barrier": 6.4e-20, "plant.apex_stiffness": 1.5}
WARM = ATOMS | {"plant.apex_mass": 4e-11, "plant.apex_damping": 1e6, "plant.temperature": 295.0}
TICKS = 200
"""In a stretch, 4 ms; the lower quartile of many counts: most of them slide, and a busy machine spoils some."""


def cases() -> dict[str, dict[str, Any]]:
    """Parameters of what is measured, by name; a cantilever that is made to tap with steps that resolve its modes."""
    made: dict[str, dict[str, Any]] = {name: {"plant.lever": name} for name in LEVERS}
    for name, lever in LEVERS.items():
        if lever.f0 > 50e3:
            made[name]["plant.dt"] = 1e-7
    made |= {f"ppp_lfmr, {name}": {"plant.scanner": name} for name in SCANNERS}
    made |= {f"ppp_lfmr, {name}": {"plant.pair": name} for name in PAIRS}
    made |= {"ppp_lfmr, rough": ROUGH, "ppp_lfmr, pi": {"onboard.kind": "pi"}}
    made |= {"ppp_lfmr, 295 K": {"plant.temperature": 295.0}, "ppp_lfmr, torsion at 0.5 us": MOVING}
    made |= {"ppp_lfmr, lattice": ATOMS, "ppp_lfmr, lattice at 295 K": WARM}
    return {name: BASE | values for name, values in made.items()}


def measure(stretches: int = 60) -> dict[str, Any]:
    """Of each case by name: `ns_per_step` and `real_time_factor`, law, ADC and score included."""
    return {name: _case(values, stretches) for name, values in cases().items()} | tapping()


def tapping(stretches: int = 12) -> dict[str, Any]:
    """The same of a tip that taps at 77 kHz, by its free amplitude [m]: in attraction, in repulsion."""
    found = {}
    for name, free in (("attraction", 10e-9), ("repulsion", 20e-9)):
        onboard = {"drive_amplitude": free / (1.5660 * 165.0), "setpoint_share": 0.7}
        with Microscope("tapping", plant={"gap": free + 30e-9}, onboard=onboard) as microscope:
            microscope.approach(rate=4e-6, range=100e-9)
            local: Any = microscope.backend
            parameters, took = local.instrument.parameters, []
            for number in range(stretches):
                start, begin = local.instrument.time, time.perf_counter()
                microscope.move_to(x=1e-9 * (1 - number % 2), y=0.0, speed=2e-8)
                took.append((time.perf_counter() - begin) / (local.instrument.time - start))
        usual = sorted(took)[stretches // 4]
        found[f"tapping, {name}"] = {"ns_per_step": usual * parameters.plant.dt * 1e9, "real_time_factor": 1.0 / usual}
    return found


def _case(values: dict[str, Any], stretches: int) -> dict[str, float]:
    parameters, usual = time_of_a_tick(values, TICKS, stretches)
    period = parameters.plant.control_period
    return {"ns_per_step": usual / parameters.plant.substeps * 1e9, "real_time_factor": period / usual}


def time_of_a_tick(values: dict[str, Any], ticks: int, stretches: int) -> tuple[InstrumentParameters, float]:
    """Parameters, and processor time of a tick [s]: lower quartile of stretches of so many ticks."""
    parameters = build(InstrumentParameters, values)
    controller = Controller(build(ControllerParameters, {"law.kind": "open_loop"}))
    instrument = Instrument(parameters, ticks)
    took = []
    for _ in range(stretches):
        begin = time.thread_time()
        instrument.close_loop(controller, ticks)
        took.append((time.thread_time() - begin) / ticks)
        instrument.skip_block()
    return parameters, sorted(took)[stretches // 4]
