"""Claims about calibrations: what they find of a simulated instrument is what it is."""

import pytest
from quick_lever import OVER_THE_WEDGE, PRESSED, WEDGE

from afm_model.microscope.verbs import CalibrateSensitivity, ThermalTune

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


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"slope_from": -60e-9, "slope_to": -30e-9},
            "between slope_from = -6e-08 m and slope_to = -3e-08 m the surface",
        ),
        ({"line_rate": 21.0}, "the line is too fast for the z loop"),
        ({"slope_angle": 0.6}, "rises by "),
    ],
)
def test_wedge_elsewhere_or_a_line_too_fast_is_named(changes, told):
    microscope = local()
    microscope.set_sample(WEDGE)
    microscope.execute(APPROACH)
    if "line_rate" in changes:
        microscope.set_gains(integral=0.02 * microscope.state.integral_gain)
    verb = OVER_THE_WEDGE.model_copy(update={"setpoints": 2, **changes})
    outcome = microscope.execute(verb)
    assert (outcome.status, outcome.result) == ("failed", None)
    assert told in outcome.message


@pytest.mark.parametrize("pair", ["si_graphite", "si_sio2"])
def test_sensitivity_is_right_within_two_uncertainties_though_the_contact_is_compressed(pair):
    microscope = local(plant__pair=pair)
    microscope.set_sample({"kind": "flat"})
    microscope.execute(APPROACH)
    found = microscope.execute(CalibrateSensitivity(count=2, rate=5e-6, lift=100e-9, ramp=300e-9)).result
    truth = microscope.operator._view.vertical_sensitivity
    assert abs(found.value - truth) < 2.0 * found.uncertainty
    assert found.uncertainty < 1e-2 * truth


def test_thermal_tune_of_a_cold_cantilever_names_its_temperature():
    outcome = local(plant__gap=400e-9).execute(ThermalTune(duration=0.05))
    assert outcome.status == "failed"
    assert "plant.temperature = 0 K" in outcome.message


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
