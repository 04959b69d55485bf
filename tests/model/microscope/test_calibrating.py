"""Claims about calibrations: what they find of a simulated instrument is what it is."""

import math

import pytest

from afm_model.microscope.verbs import CalibrateLateral, ThermalTune

from .test_local import APPROACH, local

ANGLE, STEP, TOP = math.radians(25.0), 60e-9, 100e-9
RUN = STEP / math.tan(ANGLE)
PITCH = 2.0 * RUN + 200e-9
WEDGE = {"angle": ANGLE, "step": STEP, "top": TOP, "pitch": PITCH, "edge_radius": 12e-9}
MIDDLE = 0.5 * (PITCH - TOP - RUN)


def test_wedge_gives_the_lateral_sensitivity_within_one_percent():
    # What the microscope believes of its detector has no say.
    microscope = local(detector__lateral_gain=1.25)
    microscope.set_sample({"kind": "grating"} | WEDGE)
    microscope.execute(APPROACH)
    verb = CalibrateLateral(
        slope_from=MIDDLE - 0.25 * RUN,
        slope_to=MIDDLE + 0.25 * RUN,
        flat_from=-15e-9,
        flat_to=15e-9,
        slope_angle=ANGLE,
        setpoint_to=30e-9,
        setpoints=3,
        line_rate=4.0,
    )
    outcome = microscope.execute(verb)
    assert (outcome.status, outcome.result.unit) == ("complete", "N/V")
    believed = microscope.instrument.parameters.detector.lateral_sensitivity
    assert outcome.result.estimate.value == pytest.approx(believed / 1.25, rel=0.01)
    # Behind the calibration the setpoint is that of before.
    assert microscope.state.setpoint == pytest.approx(5.0)


def test_thermal_tune_gives_the_stiffness_within_three_standard_uncertainties():
    # Beyond the reach of the van der Waals force, which softens the cantilever.
    microscope = local(plant__temperature=295.0, plant__gap=400e-9)
    outcome = microscope.execute(ThermalTune(duration=0.3))
    assert (outcome.status, outcome.result.unit) == ("complete", "N/m")
    k, cantilever = outcome.result.estimate, microscope.instrument.parameters.plant.cantilever_numbers
    assert abs(k.value - cantilever.k) < 3.0 * k.uncertainty
    # sqrt(Q / (pi f0 t)): 4.3 %.
    assert k.uncertainty < 0.06 * k.value
    assert outcome.result.details["f0_Hz"] == pytest.approx(cantilever.f0, rel=0.01)
