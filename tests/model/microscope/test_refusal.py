"""Claims about goals that cannot be: one sentence each, before anything moves; parameters that are made ready."""

import pytest
from quick_lever import PRESSED

from afm_model import ParameterError, SimParameters, build
from afm_model.microscope import (
    Approach,
    CalibrateLateral,
    CalibrateSensitivity,
    ForceCurve,
    FrictionLoop,
    MoveTo,
    Scan,
    ScanPath,
    ThermalTune,
    with_verbs,
)

from .test_local import APPROACH, local


@pytest.fixture(scope="module")
def approached():
    """A microscope on the sample."""
    microscope = local()
    microscope.execute(APPROACH)
    return microscope


@pytest.mark.parametrize(
    ("verb", "told"),
    [
        (Approach(), "Approach is not allowed: the tip is on the sample already; withdraw it first"),
        (MoveTo(y=-2e-6), "y = -2e-06 m is outside the travel of the scanner: it must be within +-1e-06 m"),
        (Scan(size_x=2e-6), "with its turns the scan goes too far: x = -1.1e-06 m is outside the travel"),
        (Scan(angle=0.7, size_x=1.5e-6), "with its turns the scan goes too far: y = -1.101e-06 m"),
        (
            Scan(line_rate=1e3, pixels=128),
            "line_rate = 1000 Hz is not allowed with pixels = 128: a pixel would be less",
        ),
        (Scan(line_rate=50.0, pixels=8), "a turn would be shorter than a period of the scanner's resonance of 500 Hz"),
        (
            Scan(channels="hight"),
            "channels = hight is not allowed: there is no hight (did you mean height?); there are asked_x, ",
        ),
        (Scan(channels=" , "), "channels is empty: it must name one at least, such as height"),
        (FrictionLoop(count=1), "count = 1 is not allowed: the first line is not part of the result; it must be >= 2"),
        (FrictionLoop(length=5e-6), "outside the travel of the scanner"),
        (ScanPath(x=(0.0, 1.0), y=(0.0, 0.0)), "x = 1 m is outside the travel of the scanner"),
        (ScanPath(x=(0.0,), y=(0.0, 1e-9)), "a path of 1 x and 2 y is not allowed"),
        (ForceCurve(lift=1e-3), "lift = 0.001 m is not allowed here: z has "),
        (ForceCurve(ramp=1e-3), "ramp = 0.001 m is not allowed here: with lift = 2e-07 m z has "),
        (CalibrateSensitivity(ramp=1e-3), "ramp = 0.001 m is not allowed here"),
        (CalibrateSensitivity(rate=1.0), "rate = 1 m/s is not allowed: within a sample of 1e-05 s z would go further"),
        (CalibrateLateral(setpoint_from=1.0), "setpoint_from = 1 N is not allowed: it must be < setpoint_to = 4e-08 N"),
        (CalibrateLateral(lines=1), "lines = 1 is not allowed: the first line is not used; it must be >= 2"),
        (
            ScanPath(x=(0.0, 1e-8), y=(0.0, 0.0), speed=1.0),
            "speed = 1 m/s is not allowed on a path of 1e-08 m: it would ",
        ),
        (ForceCurve(approach_rate=1.0), "approach_rate = 1 m/s is not allowed: within a sample of 1e-05 s z would go"),
        (ForceCurve(retract_rate=1.0), "retract_rate = 1 m/s is not allowed: within a sample of 1e-05 s z would go"),
        (ForceCurve(trigger_force=1e-9, approach_rate=1e-3), "it must be <= 0.000479 m/s"),
        (ThermalTune(), "ThermalTune is not allowed while the tip is on the sample: withdraw it first"),
    ],
    ids=lambda value: type(value).__name__ if not isinstance(value, str) else "",
)
def test_a_goal_that_cannot_be_is_refused_in_a_sentence(approached, verb, told):
    assert told in approached.objection(verb)


def test_an_approach_to_no_deflection_is_refused():
    microscope = local()
    microscope.set_setpoint(voltage=-1.0)
    assert microscope.objection(Approach()) == "Approach is not allowed with a setpoint of -1 V: it must be > 0 V"


def test_a_setpoint_or_trigger_that_the_detector_never_tells_is_refused():
    microscope = local(detector__adc_bits=16)
    never = "is not allowed: the detector saturates at 10 V, and z would go on into the sample"
    with pytest.raises(ParameterError, match=f"a setpoint of 11.97 V {never}"):
        microscope.set_setpoint(force=25e-9)
    assert microscope.state.setpoint == pytest.approx(PRESSED)
    microscope.execute(APPROACH)
    assert microscope.objection(ForceCurve(trigger_voltage=11.0)) == f"a trigger of 11 V {never}"
    assert microscope.objection(CalibrateLateral(setpoint_to=40e-9)) == f"a setpoint of 19.16 V {never}"


def test_an_approach_that_would_pass_the_setpoint_within_a_sample_is_refused():
    told = local().objection(Approach(rate=0.01))
    assert told.startswith("rate = 0.01 m/s is not allowed: within a sample of 1e-05 s z would go further than it may")
    assert local().objection(Approach(rate=0.004)) == ""


def test_any_parameters_are_made_ready_for_verbs_and_what_is_given_stays():
    given = {"plant.kind": "lever", "sample.kind": "flat", "reference.z_r": 2e-9, "detector.channels": "truth/contact"}
    made = with_verbs(build(SimParameters, given | {"run.duration": 3.0}))
    assert (made.reference.kind, made.reference.z_r, made.onboard.kind) == ("verbs", 2e-9, "pi")
    assert made.plant.gap == 500e-9
    assert made.detector.channels == "truth/contact, z_loop, z_loop_error, verb_number, verb_step"
    assert made.run.duration == 3.0
    assert with_verbs(made) == made


def test_a_plant_that_cannot_leave_the_sample_has_no_verbs():
    with pytest.raises(ParameterError, match=r"plant.kind = paper is not allowed with verbs: its tip cannot leave"):
        with_verbs(build(SimParameters, {"plant.kind": "paper"}))
