"""A case of the examiner: calibrations and loops that verbs record, of a microscope whose numbers are hidden."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

# The wedge, and what a law is told of the scanner, are those of the tests of verbs.
sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))

from quick_lever import KNOWN, LAW, OVER_THE_WEDGE, WEDGE

from afm_model import ControllerParameters, SimParameters, build
from afm_model.analysis import Estimate, friction_loop
from afm_model.analysis.loops import LoopForces
from afm_model.cantilever.tilted import tilted_deflection
from afm_model.microscope import Local
from afm_model.microscope.verbs import Approach, CalibrateLateral, CalibrateSensitivity, FrictionLoop, ThermalTune

_MICROSCOPE = {
    "plant.kind": "lever",
    "plant.control_period": 100e-6,
    "plant.temperature": 295.0,
    "piezo.limit": 50.0,
    "detector.sample_period": 10e-6,
    "onboard.kind": "pi",
    "onboard.setpoint_force": 10e-9,
    "onboard.integral_gain": 10e-6,
}


def calibrations(rng: np.random.Generator) -> Iterator[tuple[str, float, Estimate]]:
    """Hidden: spring constant, tilt, gains and crosstalk of the photodiode, its noise, that of heat."""
    k, tilt, crosstalk = rng.uniform(0.1, 0.4), rng.uniform(0.0, 0.25), rng.uniform(-0.02, 0.02)
    gain, lateral_gain = rng.uniform(0.8, 1.25, 2)
    common = {
        "plant.k": k,
        "plant.tilt": tilt,
        "plant.seed": int(rng.integers(1 << 30)),
        "detector.noise_density": 10.0 ** rng.uniform(-6.0, -5.0),
        "detector.deflection_in_lateral": crosstalk,
    }

    def found(verb: ThermalTune | CalibrateLateral | CalibrateSensitivity, **values: Any) -> tuple[Estimate, Local]:
        changes = {name.replace("__", "."): value for name, value in values.items()}
        parameters = build(SimParameters, _MICROSCOPE | common | {"sample.kind": "flat"} | changes)
        microscope = Local(parameters, build(ControllerParameters, LAW | KNOWN))
        if verb.on_sample:
            microscope.execute(Approach(rate=10e-6, range=200e-9, settle=10e-3))
        outcome = microscope.execute(verb)
        if outcome.result is None:
            raise ValueError(outcome.message)
        return outcome.result.estimate, microscope

    yield "k", k, found(ThermalTune(duration=0.2), plant__gap=400e-9)[0]
    wedge = {f"sample__{name}": value for name, value in WEDGE.items()}
    lateral, microscope = found(OVER_THE_WEDGE, plant__gap=20e-9, detector__lateral_gain=lateral_gain, **wedge)
    detector = microscope.instrument.parameters.detector
    yield "lateral, N/V", detector.lateral_sensitivity / lateral_gain, lateral
    sensitivity, microscope = found(CalibrateSensitivity(), plant__gap=20e-9, detector__deflection_gain=gain)
    c = microscope.instrument.parameters.plant.cantilever_numbers
    shown = tilted_deflection(tilt, c.tip_height + 0.5 * c.thickness, c.length)
    yield "deflection, m/V", detector.deflection_sensitivity / gain / shown, sensitivity

    def recorded(**values: Any) -> LoopForces:
        changes = {name.replace("__", "."): value for name, value in values.items()}
        parameters = build(SimParameters, _MICROSCOPE | common | {"sample.kind": "flat", "plant.gap": 20e-9} | changes)
        microscope = Local(parameters, build(ControllerParameters, LAW | KNOWN))
        microscope.execute(Approach(rate=10e-6, range=200e-9, settle=10e-3))
        loop = microscope.execute(FrictionLoop(length=60e-9, line_rate=20.0, count=4)).result
        return friction_loop(loop.position, loop.lateral)

    # Without heat, which slows friction itself; the truth is what is recorded without noise.
    loop, truth = recorded(plant__temperature=0.0), recorded(plant__temperature=0.0, detector__noise_density=0.0)
    yield "recorded loop, N", truth.half_width.value, loop.half_width
    yield "recorded loop, offset", truth.offset.value, loop.offset
    yield "recorded loop, N/m", truth.stick_slope.value, loop.stick_slope
