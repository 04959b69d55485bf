"""Claims about the section of a scenario that says the microscope once for all nodes."""

import math
from typing import Any

import numpy as np
import pytest

from afm_model import ControllerParameters, ParameterError, ScenarioError, build, flatten, load_scenario, simulate
from afm_model.parameters import Group, SimParameters, resolved

FILE = """
/**:
  ros__parameters:
    microscope: {lever: contal_g, scanner: tube_100um, k: 0.3, deflection_sensitivity: 2.0e-8, sensitivity_z: 1.26e-7,
      tilt: 0.0, SETPOINT}
/**/afm_sim_node:
  ros__parameters: {sample.kind: flat, run.duration: 0.001, reference: {amplitude_x: 0.0, amplitude_y: 0.0}, SIM}
/**/afm_controller_node:
  ros__parameters: {law.kind: pid, CONTROLLER}
"""


def scenario(tmp_path: Any, setpoint: str = "setpoint_force: 6.0e-9", sim: str = "", controller: str = "") -> Any:
    text = FILE.replace("SETPOINT", setpoint).replace("SIM", sim).replace("CONTROLLER", controller)
    (tmp_path / "one.yaml").write_text(text)
    return load_scenario(tmp_path / "one.yaml")


def test_what_is_said_once_reaches_both_nodes(tmp_path):
    read = scenario(tmp_path)
    plant, law = read.sim.plant, read.controller
    assert (plant.kind, plant.lever, plant.cantilever_numbers.k) == ("lever", "contal_g", 0.3)
    assert read.sim.detector.deflection_sensitivity == 2e-8
    assert read.sim.piezo.sensitivity_z == law.piezo.sensitivity_z == 1.26e-7
    s = plant.scanner_numbers
    for axis in "xyz":
        assert getattr(law.scanner, f"f_{axis}") == getattr(s, f"f_{axis}")
        assert getattr(law.scanner, f"xi_{axis}") == pytest.approx(0.5 / s.Q)
    assert law.cantilever.m_c * (2.0 * math.pi * law.cantilever.f_c) ** 2 == pytest.approx(0.3)
    stiffness = law.scanner.mass_ratio * law.cantilever.m_c * (2.0 * math.pi * law.scanner.f_x) ** 2
    assert stiffness == pytest.approx(s.k_x)
    assert (law.law.period, law.law.delay_ticks) == (plant.control_period, plant.delay_ticks)


@pytest.mark.parametrize("setpoint", ["setpoint_force: 6.0e-9", "setpoint_voltage: 1.0"])
@pytest.mark.parametrize("sim", ["", "onboard.kind: pi"])
def test_setpoint_in_newton_or_volt_is_that_of_the_loop_and_of_the_start(tmp_path, setpoint, sim):
    read = scenario(tmp_path, setpoint, sim)
    # 6 nN over 0.3 N/m; 1 V of 20 nm.
    assert read.sim.reference.z_r == pytest.approx(20e-9)
    run = simulate(read.sim, read.controller)
    if sim:
        assert run.deflection == pytest.approx(20e-9, rel=1e-4)
        given = read.sim.onboard.setpoint_force, read.sim.onboard.setpoint_voltage
        assert given == ((6e-9, 0.0) if "force" in setpoint else (0.0, 1.0))
    assert run.deflection[0] == pytest.approx(20e-9, rel=1e-9)


def test_a_loop_inside_may_start_elsewhere(tmp_path):
    read = scenario(tmp_path, sim="onboard.kind: pi, reference.z_r: 1.0e-8")
    assert (read.sim.reference.z_r, read.sim.onboard.setpoint_force) == (1e-8, 6e-9)


def test_a_controller_may_be_told_something_else_on_purpose(tmp_path):
    read = scenario(tmp_path, controller="scanner.f_x: 900.0, law.period: 4.0e-5")
    assert (read.controller.scanner.f_x, read.controller.law.period) == (900.0, 4e-5)
    assert read.controller.scanner.f_y == 850.0


@pytest.mark.parametrize(
    ("setpoint", "sim", "controller", "told"),
    [
        ("kk: 1.0", "", "", r"unknown parameter microscope\.kk: did you mean microscope\.k\?"),
        ("f0: -1.0", "", "", r"microscope\.f0 = -1\.0 Hz is not allowed"),
        ("setpoint_force: 1.0e-9, setpoint_voltage: 1.0", "", "", "are not allowed together: give one"),
        ("Q: 50.0", "plant.Q: 40.0", "", r"plant\.Q is given twice"),
        ("setpoint_voltage: 1.0", "reference.z_r: 1.0e-8", "", r"reference\.z_r is given twice"),
        ("Q: 50.0", "plant.kind: compliant", "", r"plant\.kind = compliant is not allowed with microscope"),
        ("Q: 50.0", "", "microscope.k: 1.0", r"microscope\.k is for all nodes: it must stand in section /\*\*"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(tmp_path, setpoint, sim, controller, told):
    with pytest.raises(ScenarioError, match=told):
        scenario(tmp_path, setpoint, sim, controller)


def test_section_for_all_holds_nothing_else(tmp_path):
    (tmp_path / "one.yaml").write_text("/**:\n  ros__parameters: {run.duration: 1.0}\n")
    with pytest.raises(ScenarioError, match=r"unknown section /\*\* for run\.duration"):
        load_scenario(tmp_path / "one.yaml")


def test_section_for_all_alone_is_a_scenario_and_other_nodes_pass_it_by(tmp_path):
    (tmp_path / "one.yaml").write_text("/**:\n  ros__parameters: {microscope.lever: snl_10b}\n")
    read = load_scenario(tmp_path / "one.yaml")
    assert read.sim.plant.lever == "snl_10b"
    assert read.controller.cantilever.f_c == 23e3

    class Other(Group):
        depth: int = 1

    assert resolved(Other, {"microscope.k": 1.0, "depth": 2}) == {"depth": 2}
    with pytest.raises(ParameterError, match=r"unknown parameter microscope\.depth"):
        resolved(Other, {"microscope.depth": 1.0})


def test_overrides_change_the_microscope_of_both_nodes(tmp_path):
    scenario(tmp_path)
    (tmp_path / "more.yaml").write_text("/**:\n  ros__parameters: {microscope.f_x: 700.0}\n")
    read = load_scenario(tmp_path / "one.yaml", overrides=tmp_path / "more.yaml")
    assert read.sim.plant.scanner_numbers.f_x == read.controller.scanner.f_x == 700.0


def test_without_the_section_nothing_changes():
    for model in (SimParameters, ControllerParameters):
        assert resolved(model, {"piezo.limit": 3.0}) == {"piezo.limit": 3.0}


@pytest.mark.parametrize("kind", ["flat", "grating", "rough", "patches"])
def test_scales_do_not_change_what_a_sample_in_metres_does_to_the_lever(kind):
    # The same numbers in other units: equal within round-off, which a sliding contact carries on.
    values = {
        "plant.kind": "lever",
        "sample.kind": kind,
        "reference.z_r": 50e-9,
        "reference.amplitude_x": 20e-9,
        "reference.omega_x": 2.0 * math.pi * 200.0,
        "onboard.kind": "pi",
        "run.duration": 1.5e-3,
    }
    if kind == "grating":
        values |= {"sample.pitch": 300e-9, "sample.top": 100e-9, "sample.step": 2e-9, "sample.angle": 0.2}
    if kind == "rough":
        values |= {"sample.size": 256e-9, "sample.pixels": 64}
    other = {"scales.x0": 1e-9, "scales.z0": 1e-9, "scales.w0": 3e4}
    runs = [
        simulate(build(SimParameters, values | more), build(ControllerParameters, {"law.kind": "open_loop"}))
        for more in ({}, other)
    ]
    for name in ("deflection", "lateral_force"):
        a, b = (getattr(each, name) for each in runs)
        assert np.ptp(a) > 0.0
        assert b == pytest.approx(a, abs=1e-7 * np.abs(a).max())
    assert flatten(runs[1].parameters)["scales.x0"] == 1e-9
