"""Runs of the simulated microscope whose records are analysed: what a user would save, and nothing more."""

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from afm_model import ControllerParameters, Simulation, build, simulate
from afm_model.parameters import SimParameters

UPRIGHT = {"plant.kind": "lever", "plant.tilt": 0.0, "plant.scanner": "stack_13um", "onboard.kind": "pi"}
K = 0.2
"""Spring constant of the default cantilever [N/m]."""


def run(values: dict[str, Any]) -> Simulation:
    """The microscope with the reference of x and y as their drive."""
    parameters = build(SimParameters, UPRIGHT | {"sample.kind": "flat"} | values)
    if parameters.run.duration == 0.0:
        longest = {"run.duration": parameters.reference.longest}
        parameters = build(SimParameters, UPRIGHT | {"sample.kind": "flat"} | values | longest)
    # The open loop of the paper sends forces in units of the scanner with the frequency w_0: with it, the reference.
    frequency = parameters.scales.w0 / (2.0 * math.pi)
    law: dict[str, Any] = {"law.kind": "open_loop"} | {f"scanner.f_{axis}": frequency for axis in "xyz"}
    return simulate(parameters, build(ControllerParameters, law))


CURVE = {
    "reference.kind": "force_curve",
    "plant.gap": 40e-9,
    "reference.ramp": 300e-9,
    "reference.approach_rate": 2e-6,
    "reference.retract_rate": 2e-6,
    "reference.trigger_force": 20e-9,
    "detector.channels": "z_loop, curve_phase, curves_done, curve_triggered, z_offset, truth/contact",
}


class Curve(NamedTuple):
    """One force curve as it is saved."""

    z: np.ndarray  # [m]
    voltage: np.ndarray
    deflection: np.ndarray
    done: Simulation


def curve(values: dict[str, Any], **more: Any) -> Curve:
    """A force curve from settling to the end of the retract."""
    done = run(CURVE | values | {name.replace("__", "."): value for name, value in more.items()})
    phase = done.channel("curve_phase")
    part = (phase >= 1.0) & (phase <= 4.0)
    deflection = done.channel("deflection")[part]
    return Curve(
        done.channel("z_loop")[part], deflection / done.parameters.detector.deflection_sensitivity, deflection, done
    )


class Line(NamedTuple):
    """Two lines of a scan across a ridge of the grating, at the control ticks, from the first turn on."""

    position: np.ndarray  # [m]
    voltage: np.ndarray  # lateral
    load: np.ndarray  # [N]
    slope: float  # place of the middle of a slope [m]
    width: float  # over which the slope is straight on both sides of its middle [m]


@cache
def grating_line(angle: float, load: float, **more: Any) -> Line:
    """A line over flat, slope and top under a setpoint."""
    step = 60e-9
    run_up = step / math.tan(angle)
    pitch, top = 2.0 * run_up + 200e-9, 100e-9
    sample = {
        "sample.kind": "grating",
        "sample.angle": angle,
        "sample.step": step,
        "sample.pitch": pitch,
        "sample.top": top,
        "sample.edge_radius": 12e-9,
    }
    lines = 8.0  # [Hz]
    values = {
        "onboard.setpoint_force": load,
        "onboard.integral_gain": 50e-6,
        "reference.z_r": load / K,
        "reference.shape_x": "triangle",
        "reference.amplitude_x": 0.5 * pitch,
        "reference.amplitude_y": 0.0,
        "reference.omega_x": 2.0 * math.pi * lines,
        "run.duration": 1.25 / lines,
    }
    done = run(sample | values | {name.replace("__", "."): value for name, value in more.items()})
    whole = done.time >= 0.25 / lines
    return Line(
        done.position[whole, 0],
        done.measurements["lateral_voltage"][whole],
        K * done.deflection[whole],
        0.5 * (pitch - top - run_up),
        0.25 * run_up,
    )
