"""Claims about calibrations put in use: verbs and their notes believe them, the plant keeps its own."""

import numpy as np
import pytest
from quick_lever import OVER_THE_WEDGE, PRESSED, WEDGE

from afm_model import ParameterError
from afm_model.files import write_curve_tab
from afm_model.microscope import Microscope
from afm_model.microscope.results import Calibration
from afm_model.microscope.verbs import (
    CalibrateSensitivity,
    ForceCurve,
    FrictionLoop,
    MoveTo,
    Scan,
    ScanPath,
    ThermalTune,
    Withdraw,
)
from afm_model.microscope.verbs.scan import notes

from .test_local import APPROACH, SCAN, local

CURVE = ForceCurve(trigger_force=20e-9, approach_rate=20e-6, retract_rate=20e-6, lift=150e-9)


def _pull_off(microscope) -> float:
    """Of a force curve, by the spring constant and sensitivity that the microscope believes [N]."""
    (curve,) = microscope.execute(CURVE).result
    return -float(curve.arrays().variables["force"].values.min())


def test_a_spring_constant_wrong_by_20_percent_makes_forces_wrong_by_20_percent_until_it_is_calibrated_and_used():
    """Pull-off forces as measured; what presses is the force at the setpoint."""
    cold = local()
    cold.execute(APPROACH)
    true = _pull_off(cold)
    wrong = local(calibration__spring_constant=0.24, plant__temperature=295.0, plant__gap=400e-9)
    found = wrong.execute(ThermalTune(duration=0.3)).result
    wrong.execute(APPROACH.model_copy(update={"range": 1e-6}))
    assert wrong.state.setpoint == pytest.approx(PRESSED / 1.2)
    # Heat takes 0 to 7 % of a pull-off force, at any step.
    assert _pull_off(wrong) == pytest.approx(1.17 * true, rel=0.05)
    wrong.use(found)
    assert wrong.state.setpoint == pytest.approx(PRESSED * 0.2 / found.value)
    right = _pull_off(wrong)
    assert abs(right - true) < (2.0 * found.uncertainty / found.value + 0.07) * true
    assert right < 1.12 * true


def test_the_plant_keeps_its_own_numbers():
    volts = {"onboard__setpoint_force": 0.0, "onboard__setpoint_voltage": 4.0}
    believed = {"calibration__deflection_sensitivity": 11.66e-9, "calibration__lateral_sensitivity": 75e-9}
    known, told = local(**volts), local(**volts, **believed)
    images = []
    for microscope in (known, told):
        microscope.execute(APPROACH)
        images.append(microscope.execute(SCAN).result)
    assert known.instrument.trajectory_sha256() == told.instrument.trajectory_sha256()
    heights, laterals = ([image.data[name, "trace"] for image in images] for name in ("height", "lateral"))
    assert np.array_equal(*heights)
    # The detector's 50 nN/V.
    assert laterals[1] == pytest.approx(1.5 * laterals[0], rel=1e-12)


def test_a_sensitivity_from_force_curves_makes_their_slope_one_and_the_thermal_tune_right():
    microscope = local(detector__deflection_gain=1.25, plant__temperature=295.0, plant__gap=400e-9)
    before = microscope.execute(ThermalTune(duration=0.3)).result
    microscope.execute(APPROACH.model_copy(update={"range": 1e-6}))
    found = microscope.execute(CalibrateSensitivity(rate=5e-6, count=1)).result
    microscope.use(found)
    view = microscope.operator._view
    assert view.vertical_sensitivity == pytest.approx(found.value, rel=1e-12)
    # Across the cantilever it is 10 nm/V, and the detector shows 1.25 times as many volts.
    assert found.uncertainty < 0.03 * found.value
    assert view.deflection_sensitivity == pytest.approx(8e-9, rel=2.5 * found.uncertainty / found.value)
    microscope.execute(Withdraw(distance=400e-9, rate=50e-6))
    after = microscope.execute(ThermalTune(duration=0.3)).result
    # A spring constant is as the inverse square of the sensitivity, and names the one that it was found with.
    assert before.details["deflection_sensitivity_m_V"] == 10e-9
    assert after.details["deflection_sensitivity_m_V"] == view.deflection_sensitivity
    assert before.value < 0.75 * 0.2
    assert abs(after.value - 0.2) < 3.0 * after.uncertainty


def test_a_lateral_sensitivity_from_a_wedge_makes_friction_right():
    microscope = local(detector__lateral_gain=1.25)
    microscope.set_sample(WEDGE)
    microscope.execute(APPROACH)
    found = microscope.execute(OVER_THE_WEDGE).result
    assert found.details["spring_constant_N_m"] == 0.2
    loop = FrictionLoop(length=10e-9, line_rate=10.0)
    microscope.execute(MoveTo(x=0.0))
    before = microscope.execute(loop).result
    microscope.use(found)
    after = microscope.execute(loop).result
    assert after.arrays().attributes["lateral_sensitivity"] == found.value
    assert np.ptp(before.lateral) / np.ptp(after.lateral) == pytest.approx(1.25, rel=0.01)
    path = microscope.execute(ScanPath(x=(0.0, 20e-9), y=(0.0, 0.0), speed=1e-6)).result
    assert path.arrays().attributes["lateral_sensitivity"] == found.value


def test_notes_and_files_name_what_was_used(tmp_path):
    microscope = local(calibration__spring_constant=0.24)
    written = notes(microscope.instrument.parameters)
    assert "k = 0.24 N/m" in written["Cantilever"]
    assert written["Calibrated"] == "spring constant"
    assert "Calibrated" not in notes(local().instrument.parameters)
    microscope.execute(APPROACH)
    assert microscope.execute(Scan(size_x=40e-9, pixels=16, lines=1, line_rate=20.0)).result.metadata == written
    (curve,) = microscope.execute(CURVE).result
    stiffness = microscope.operator._view.vertical_stiffness
    assert f'"spring constant": {stiffness!r}' in write_curve_tab(tmp_path / "a.tab", curve).read_text()
    assert stiffness == pytest.approx(1.2 * local().operator._view.vertical_stiffness)


def test_what_is_no_calibration_is_refused_and_another_probe_has_none():
    with Microscope("two_materials") as microscope:
        microscope.use(Calibration(0.3, 0.01, "N/m"), lateral_sensitivity=60e-9)
        used = microscope.backend.instrument.parameters.calibration
        assert (used.spring_constant, used.deflection_sensitivity, used.lateral_sensitivity) == (0.3, 0.0, 60e-9)
        for wrong, sentence in (
            ({"stiffness": 1.0}, "stiffness is no calibration: there are spring_constant"),
            ({"spring_constant": -1.0}, r"calibration.spring_constant = -1.0 .* is not allowed"),
        ):
            with pytest.raises(ParameterError, match=sentence):
                microscope.use(**wrong)
        with pytest.raises(ParameterError, match="must be a calibration, in one of N/m, m/V, N/V"):
            microscope.use(Calibration(1e-9, 0.0, "m"))
        microscope.set_probe(lever="contal_g")
        assert microscope.backend.instrument.parameters.calibration.spring_constant == 0.0
