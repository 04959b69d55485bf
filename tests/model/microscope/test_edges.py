"""Claims about verbs at the edge of what can be: end of the range of z, no trigger, hard presses, errors of callers."""

import re

import numpy as np
import pytest

from afm_model import ParameterError
from afm_model.core.schema import specifications
from afm_model.microscope import Microscope, all_verbs, to_xarray
from afm_model.microscope.results import CANCELLED, COMPLETE, FAILED
from afm_model.microscope.verbs import (
    Approach,
    CalibrateSensitivity,
    ForceCurve,
    FrictionLoop,
    Scan,
    ScanPath,
    ThermalTune,
    Withdraw,
)
from afm_model.program.force_curve import APPROACH as APPROACHING
from afm_model.program.force_curve import DWELL, RETRACT

from .test_local import APPROACH, local

LINE = Scan(size_x=40e-9, pixels=2, lines=1, line_rate=20.0)


@pytest.fixture
def approached():
    microscope = local(block_ticks=10)
    assert microscope.execute(APPROACH).status == COMPLETE
    return microscope


def test_phases_of_a_curve_come_in_order_whatever_samples_are_averaged(approached):
    for sample_rate in (100e3, 30e3, 13e3):
        verb = ForceCurve(trigger_force=20e-9, approach_rate=20e-6, retract_rate=20e-6, sample_rate=sample_rate)
        (curve,) = approached.execute(verb).result
        phase = curve.record.channels["phase"]
        assert (np.diff(phase) >= 0.0).all(), sample_rate
        assert set(phase) <= {APPROACHING, DWELL, RETRACT}
        assert phase[-1] == RETRACT


def test_cancel_in_a_curve_that_presses_far_into_the_sample_leaves_the_tip_off_it(approached):
    verb = ForceCurve(lift=50e-9, ramp=800e-9, approach_rate=50e-6, dwell=1.0)
    approached.operator.begin(verb)
    while approached.operator.progress.fraction == 0.0 or approached.instrument.orders.program.at != 3.0:
        approached.step()
    # 750 nm beyond the setpoint: further than a tip is usually withdrawn by.
    assert approached.operator._view.offset == pytest.approx(750e-9)
    approached.operator.cancel()
    while approached.operator.busy:
        approached.step()
    assert approached.operator.outcome().status == CANCELLED
    assert not approached.instrument.in_contact
    assert approached.instrument.measurement[3] == pytest.approx(0.0, abs=0.1)


def test_a_lift_that_does_not_leave_the_sample_finds_it_again(approached):
    verb = ForceCurve(lift=10e-9, ramp=30e-9, approach_rate=2e-6, retract_rate=2e-6)
    message = approached.execute(verb).message
    assert message.startswith("lift = 10 nm is below the pull-off distance of ")
    assert " nm: the tip stays in contact. Use at least " in message
    assert approached.state.approached
    assert approached.instrument.in_contact


def test_a_calibration_whose_curves_never_trigger_fails_and_the_tip_is_withdrawn(approached):
    outcome = approached.execute(
        CalibrateSensitivity(ramp=60e-9, lift=60e-9, rate=20e-6, trigger_voltage=49.0, count=1)
    )
    assert (outcome.status, outcome.result) == (FAILED, None)
    assert outcome.message == (
        "no sensitivity comes out of the curves: in none of them the deflection rose by trigger_voltage = 49 V within "
        "ramp = 6e-08 m"
    )
    assert not approached.state.near
    assert not approached.instrument.in_contact


def test_an_error_of_who_is_told_of_lines_withdraws_the_tip_and_is_raised(approached):
    def broken(line):
        raise OSError("no space left")

    with pytest.raises(OSError, match="no space left"):
        approached.execute(LINE.model_copy(update={"lines": 50}), on_line=broken)
    assert not approached.operator.busy
    assert not approached.state.near
    assert not approached.instrument.in_contact
    # Nothing is in the way of going on.
    assert approached.objection(APPROACH) == ""


def test_a_scan_says_that_z_was_at_the_end_of_its_range():
    pytest.importorskip("xarray")
    sloped = local()
    sloped.set_sample({"kind": "plane", "angle_x": 0.4636})
    sloped.execute(APPROACH)
    # It would take 10 nm to both sides.
    low = sloped.instrument.orders.onboard.z - 5e-9
    sloped.operator._view.set_loop(low=low)
    microscope = Microscope(sloped)
    with pytest.warns(UserWarning, match="z was at the end of its range in 2 of 2 lines: the height is not that of"):
        image = microscope.scan(size_x=40e-9, size_y=4e-9, pixels=16, lines=2, line_rate=5.0)
    assert microscope.outcome.status == COMPLETE
    assert float(image["height"].max()) == pytest.approx(-low)
    assert image.attrs["Remark"] == microscope.outcome.message
    sloped.operator._view.set_loop(low=low - 100e-9)
    assert sloped.execute(LINE).message == ""


@pytest.mark.parametrize("angle", [0.0, 2.0])
def test_a_line_of_two_pixels_with_the_slow_axis_off_is_in_the_middle_of_the_frame(approached, angle):
    scan = LINE.model_copy(
        update={"lines": 3, "size_y": 30e-9, "slow_axis": False, "angle": angle, "direction": "down"}
    )
    outcome = approached.execute(scan.model_copy(update={"channels": "x, y, height"}))
    assert outcome.result.complete
    read = to_xarray(outcome.result)
    for axis in "xy":
        measured = np.asarray(read[f"measured_{axis}"].sel(direction="trace"))
        assert measured == pytest.approx(np.asarray(read[f"place_{axis}"]), abs=0.2e-9)


def test_a_withdrawal_that_the_range_of_z_ends_says_so(approached):
    z, (low, _) = approached.instrument.orders.onboard.z, approached.operator._view.z_range
    outcome = approached.execute(Withdraw(distance=2e-6, rate=1e-3))
    assert outcome.status == COMPLETE
    assert outcome.message == (
        f"z went {z - low:.4g} m, not distance = 2e-06 m: its range ends there, and the tip may still touch the sample"
    )
    assert approached.instrument.orders.onboard.z == pytest.approx(low)


EXTREME = (1e300, -1e300, 5e-324, float("nan"), float("inf"), -0.0, 10**400)


def extremes():
    """Every number of every verb, as large and as small as can be written, and as its range has it."""
    for verb in all_verbs().values():
        path = {"x": (0.0, 1e-7), "y": (0.0, 0.0)} if verb is ScanPath else {}
        for spec in specifications(verb):
            listed = spec.kind not in (int, float, str, bool)
            for value in (*EXTREME, spec.lower, spec.upper) if spec.kind in (int, float) or listed else ():
                yield verb, spec, value, path | {spec.name: (0.0, value) if listed else value}


def test_verb_with_a_number_of_any_size_is_refused_in_a_sentence_or_can_be_cancelled():
    microscope, begun, refused = local(), 0, []
    for kind, spec, value, fields in extremes():
        try:
            verb = kind.of(fields)
        except ParameterError as error:
            refused.append((spec.name, str(error)))
            continue
        assert value == 0.0 or value in (spec.lower, spec.upper), (kind, spec.name, value)
        if not microscope.state.approached and not isinstance(verb, Approach | ThermalTune):
            microscope = local()  # wherever the last one has moved z to
            assert microscope.execute(APPROACH).status == COMPLETE
        told = microscope.objection(verb)
        if told:
            assert " is not allowed" in told or "must be" in told or "outside" in told, told
            continue
        begun += 1
        microscope.operator.begin(verb)
        microscope.step()
        microscope.operator.cancel()
        while microscope.operator.busy:
            microscope.step()
        # One that is over at once has done what it was asked for.
        assert microscope.operator.outcome().status != CANCELLED or not microscope.instrument.in_contact, verb
        assert np.isfinite(microscope.instrument.measurement).all(), verb
    assert begun > 20
    assert len(refused) > 300
    for name, told in refused:
        assert told.startswith(name), told
        assert " is not allowed: it must be a " in told, told


def test_number_beyond_its_range_in_a_verb_that_was_made_by_hand_is_refused_too():
    assert local().objection(Withdraw(distance=5e-324)) == (
        "distance = 5e-324 m is not allowed: it must be a finite number >= 1e-18 and <= 1"
    )


@pytest.mark.parametrize(
    "verb",
    [
        Scan(size_x=40e-9, pixels=8192, lines=8192),
        ForceCurve(count=1_000_000),
        ThermalTune(duration=600.0),
        ScanPath(x=(0.0, 1e-7), y=(0.0, 0.0), speed=1e-12, sample_rate=1e5),
    ],
    ids=lambda verb: verb.name,
)
def test_what_would_bring_back_more_than_memory_holds_is_refused_at_once(approached, verb):
    if isinstance(verb, ThermalTune):
        approached.execute(Withdraw())
    told = approached.objection(verb)
    assert "is not allowed: it would bring back " in told, told
    assert told.endswith(" numbers, and 33554432 are the most")


def test_path_of_very_many_places_is_refused_at_once(approached):
    verb = ScanPath(x=tuple(1e-12 * n for n in range(10_001)), y=(0.0,) * 10_001)
    assert approached.objection(verb) == "a path of 10001 places is not allowed: 10000 are the most"


def test_curve_that_never_triggers_or_rises_far_beyond_its_trigger_says_so(approached):
    never = approached.execute(ForceCurve(lift=60e-9, ramp=80e-9, approach_rate=20e-6, trigger_force=20e-9, count=2))
    assert never.status == COMPLETE
    assert re.match(r"in 2 of 2 curves the deflection did not rise by the trigger of \S+ V within ramp", never.message)
    fast = ForceCurve(lift=100e-9, ramp=400e-9, approach_rate=500e-6, retract_rate=20e-6, trigger_force=5e-9)
    outcome = approached.execute(fast)
    (curve,) = outcome.result
    volts, phase = (curve.record.channels[name] for name in ("deflection_voltage", "phase"))
    rise = (volts.max() - volts[phase == APPROACHING][0]) / curve.trigger
    assert rise > 1.15
    found = re.match(r"the deflection rose to (\S+) times the trigger", outcome.message)
    assert found and float(found[1]) == pytest.approx(rise, rel=0.05)
    slow = ForceCurve(lift=100e-9, ramp=400e-9, approach_rate=10e-6, retract_rate=20e-6, trigger_force=20e-9)
    assert approached.execute(slow).message == ""


def test_tip_that_its_loop_has_moved_off_the_sample_is_approached_no_more(approached):
    approached.set_setpoint(force=-80e-9)
    outcome = approached.execute(FrictionLoop(length=20e-9, line_rate=10.0))
    assert outcome.status == COMPLETE
    assert "the tip is off the sample at the end, and its loop does not bring it back: setpoint -" in outcome.message
    assert not approached.state.approached
    assert "not allowed while the tip is withdrawn" in approached.objection(FrictionLoop())
