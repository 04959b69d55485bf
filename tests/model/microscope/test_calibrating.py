"""Claims about calibrations: what they find of a simulated instrument is what it is."""

import pytest
from quick_lever import OVER_THE_WEDGE, PRESSED, WEDGE

from afm_model.microscope.verbs import ThermalTune

from .test_local import APPROACH, local


def test_wedge_gives_the_lateral_sensitivity_within_one_percent():
    # What the microscope believes of its detector has no say.
    microscope = local(detector__lateral_gain=1.25)
    microscope.set_sample(WEDGE)
    microscope.execute(APPROACH)
    outcome = microscope.execute(OVER_THE_WEDGE)
    assert (outcome.status, outcome.result.unit) == ("complete", "N/V")
    believed = microscope.instrument.parameters.detector.lateral_sensitivity
    assert outcome.result.estimate.value == pytest.approx(believed / 1.25, rel=0.01)
    # Behind the calibration the setpoint is that of before.
    assert microscope.state.setpoint == pytest.approx(PRESSED)


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
