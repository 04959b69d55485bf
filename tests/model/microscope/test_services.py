"""Claims about cancelling, feedback, setpoint, gains, another sample or probe."""

import pytest
from quick_lever import PRESSED

from afm_model import ParameterError, VerbError
from afm_model.microscope.results import CANCELLED, COMPLETE
from afm_model.microscope.verbs import (
    Approach,
    CalibrateLateral,
    CalibrateSensitivity,
    ForceCurve,
    FrictionLoop,
    MoveTo,
    Scan,
    ScanPath,
    ThermalTune,
    Withdraw,
)

from .test_local import APPROACH, SCAN, local

FAST_CURVE = ForceCurve(trigger_force=20e-9, approach_rate=20e-6, retract_rate=20e-6, lift=150e-9)
PATH = ScanPath(x=(0.0, 20e-9, 20e-9), y=(0.0, 0.0, 20e-9), speed=1e-6)


@pytest.mark.parametrize(
    ("verb", "after"),
    [
        (APPROACH, 0.004),
        (MoveTo(x=50e-9, y=0.0, speed=1e-6), 0.05),
        (FAST_CURVE, 0.015),
        (FrictionLoop(length=10e-9, line_rate=10.0), 0.08),
        (SCAN, 0.03),
        (PATH, 0.02),
        (CalibrateSensitivity(rate=20e-6), 0.01),
        (CalibrateLateral(line_rate=5.0, setpoints=2), 0.1),
        (ThermalTune(duration=0.1), 0.01),
        (Withdraw(rate=50e-6), 0.002),
    ],
    ids=lambda value: type(value).__name__ if not isinstance(value, float) else "",
)
def test_a_verb_that_is_cancelled_leaves_the_tip_withdrawn_and_the_scanner_at_rest(verb, after):
    microscope = local(block_ticks=10)
    if not isinstance(verb, Approach | ThermalTune):
        microscope.execute(APPROACH)
    begin = microscope.time
    microscope.operator.begin(verb)
    while microscope.time < begin + after:
        microscope.step()
    assert microscope.operator.busy
    microscope.operator.cancel()
    while microscope.operator.busy:
        microscope.step()
    outcome = microscope.operator.outcome()
    assert outcome.status == CANCELLED
    assert outcome.message == f"{type(verb).__name__} was cancelled; the tip is withdrawn"
    assert microscope.time < begin + after + 0.1
    assert not microscope.state.approached
    assert not microscope.instrument.in_contact
    assert microscope.state.setpoint == pytest.approx(PRESSED)
    asked = microscope.instrument.orders.asked
    assert [*asked.velocity, *asked.acceleration] == pytest.approx([0.0] * 6, abs=1e-15)
    # It goes on from there.
    assert microscope.execute(Approach(rate=20e-6, range=2e-6, settle=5e-3)).status == COMPLETE


def test_a_cancelled_scan_keeps_the_lines_that_were_measured():
    microscope = local(block_ticks=10)
    microscope.execute(APPROACH)
    microscope.operator.begin(Scan(size_x=40e-9, pixels=16, lines=8, line_rate=20.0))
    assert microscope.operator.progress.fraction < 0.05
    while microscope.operator.progress.detail != "line 3 of 8":
        microscope.step()
    assert 0.2 < microscope.operator.progress.fraction < 0.4
    microscope.operator.cancel()
    while microscope.operator.busy:
        microscope.step()
    image = microscope.operator.outcome().result
    assert not image.complete
    assert image.lines_done == 2
    lateral = image.data["lateral", "trace"]
    assert (lateral[:2] == lateral[:2]).all()
    assert (lateral[3:] != lateral[3:]).all()  # NaN


@pytest.mark.parametrize("verb", [PATH, FrictionLoop(length=10e-9, line_rate=10.0)], ids=["path", "loop"])
def test_a_verb_cancelled_before_its_first_sample_has_a_result_of_none_that_goes_over_topics(verb):
    microscope = local(block_ticks=10)
    microscope.execute(APPROACH)
    microscope.execute(MoveTo(x=-20e-9))
    microscope.operator.begin(verb)
    microscope.operator.cancel()
    while microscope.operator.busy:
        microscope.step()
    result = microscope.operator.outcome().result
    if isinstance(verb, ScanPath):
        # A message of it has a unit for each channel.
        assert result.record.units == {"x": "m", "y": "m", "height": "m", "error": "V", "lateral": "N"}
        assert {len(values) for values in result.record.channels.values()} == {0}
    else:
        assert len(result.lateral) == len(result.time) == 0


def test_a_verb_during_another_one_is_refused_and_disturbs_nothing():
    microscope = local(block_ticks=10)
    microscope.operator.begin(APPROACH)
    microscope.step()
    with pytest.raises(VerbError, match="MoveTo is not allowed while Approach is being done"):
        microscope.operator.begin(MoveTo())
    while microscope.operator.busy:
        microscope.step()
    assert microscope.operator.outcome().status == COMPLETE


def test_setpoint_and_gains_change_while_it_follows():
    microscope = local()
    microscope.execute(APPROACH)
    microscope.set_setpoint(force=20e-9)
    assert microscope.state.setpoint == pytest.approx(2.0 * PRESSED)
    standing = microscope.execute(MoveTo(x=10e-9, speed=0.5e-6)).result
    assert standing.deflection_voltage == pytest.approx(2.0 * PRESSED, rel=1e-3)
    before = microscope.instrument.orders.onboard.z
    microscope.set_gains(proportional=0.1e-9, integral=5e-6)
    state = microscope.state
    assert (state.proportional_gain, state.integral_gain) == (0.1e-9, 5e-6)
    microscope.set_setpoint(voltage=5.0)
    standing = microscope.execute(MoveTo(x=0.0, speed=0.5e-6)).result
    assert standing.deflection_voltage == pytest.approx(5.0, rel=1e-3)
    # Back by 5 V at 9.71 nm/V: the cantilever is tilted.
    assert standing.z - before == pytest.approx((5.0 - 2.0 * PRESSED) * 9.71e-9, rel=2e-3)
    for call in (lambda: microscope.set_setpoint(), lambda: microscope.set_setpoint(force=1e-9, voltage=1.0)):
        with pytest.raises(ParameterError, match="give one of them"):
            call()
    with pytest.raises(ParameterError, match=r"onboard.integral_gain = -1.0 .* is not allowed"):
        microscope.set_gains(integral=-1.0)


def test_feedback_is_held_switched_off_and_given_to_the_controller():
    microscope = local()
    microscope.set_sample({"kind": "plane", "angle_x": 0.01})
    microscope.execute(APPROACH)
    z = microscope.instrument.orders.onboard.z
    microscope.set_feedback("hold")
    # Without feedback the slope bends the cantilever: 30 nm along x are 0.3 nm.
    image = microscope.execute(Scan(size_x=30e-9, size_y=1e-9, pixels=4, lines=1, line_rate=20.0)).result
    assert microscope.instrument.orders.onboard.z == z
    rise = image.data["error", "trace"][0]
    assert 10e-9 * (rise[3] - rise[0]) == pytest.approx(0.75 * 0.3e-9, rel=0.1)
    microscope.set_feedback("off")
    with pytest.raises(VerbError, match="Scan is not allowed with feedback = off"):
        microscope.execute(SCAN)
    # Moved by a verb, z stays held behind it.
    assert microscope.execute(FAST_CURVE).status == COMPLETE
    z = microscope.instrument.orders.onboard.z
    microscope.execute(MoveTo(x=10e-9))
    assert microscope.instrument.orders.onboard.z == z
    microscope.set_feedback("external")
    microscope.execute(MoveTo(x=0.0))
    volts = microscope.instrument.drive[2]
    assert microscope.instrument.numbers("regulated")[2] == pytest.approx(volts, abs=1e-15)
    # To withdraw, the instrument needs nobody; the controller has pressed beyond the range of the photodiode.
    assert microscope.execute(Withdraw(distance=2e-6, rate=50e-6)).status == COMPLETE
    assert not microscope.instrument.in_contact
    with pytest.raises(ParameterError, match=r"onboard.feedback = of is not allowed: it must be one of on, hold, off"):
        microscope.set_feedback("of")


def test_another_sample_or_probe_is_put_in_only_with_the_tip_withdrawn():
    microscope = local()
    microscope.execute(APPROACH)
    with pytest.raises(VerbError, match="another sample is not allowed while the tip may touch the sample"):
        microscope.set_sample({"strength": 0.2})
    microscope.execute(Withdraw(rate=50e-6))
    with pytest.raises(ParameterError, match=r"unknown parameter sample.strenght: did you mean sample.strength"):
        microscope.set_sample({"strenght": 0.2})
    with pytest.raises(ParameterError, match=r"plant.control_period is no property of a probe"):
        microscope.set_probe({"lever": "contal_g", "control_period": 1e-4})
    microscope.set_sample({"kind": "flat"})
    microscope.set_probe({"lever": "contal_g"})
    assert microscope.time == 0.0
    parameters = microscope.instrument.parameters
    assert (parameters.sample.kind, parameters.plant.lever) == ("flat", "contal_g")
    assert microscope.execute(APPROACH).status == COMPLETE
