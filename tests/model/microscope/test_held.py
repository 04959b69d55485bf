"""Claims about a tip that stays on the sample when a verb is stopped, and about z that is held, moved and limited."""

import pytest

from afm_model import ParameterError, VerbError
from afm_model.microscope import Microscope
from afm_model.microscope.results import CANCELLED, FAILED

pytest.importorskip("xarray")
FAST = {"rate": 20e-6, "range": 2e-6, "settle": 5e-3}
LONG = {"size_x": 80e-9, "pixels": 16, "lines": 500, "line_rate": 20.0}


@pytest.fixture(scope="module")
def microscope():
    with Microscope("two_materials", sample={"width": 20e-9}) as made:
        yield made


@pytest.fixture(autouse=True)
def approached(microscope):
    """Tip on the sample, feedback on, nobody listens."""
    microscope.on_line = microscope.on_progress = None
    if not microscope.state.approached:
        if microscope.state.near:
            microscope.withdraw()
        microscope.approach(**FAST)
    microscope.set_feedback("on")


def value(microscope, name):
    return microscope.read_signals(name)[name].value


def stopped(microscope, after, verb, **fields):
    """Outcome of a verb that is stopped with its tip on the sample, when `after` of its progress have passed."""
    microscope.on_progress = lambda progress: microscope.stop(stay=True) if progress.fraction > after else None
    with pytest.raises(VerbError):
        microscope.do(verb, **fields)
    microscope.on_progress = None
    return microscope.outcome


def test_scan_that_is_stopped_leaves_its_tip_on_the_sample_under_feedback_and_the_next_verb_goes_on(microscope):
    outcome = stopped(microscope, 0.02, "scan", **LONG)
    assert (outcome.status, outcome.message) == (CANCELLED, "Scan was stopped; the tip stays on the sample")
    assert 1 <= outcome.result.lines_done < 500
    state = microscope.state
    assert (state.approached, state.near, state.feedback) == (True, True, "on")
    assert microscope.backend.instrument.in_contact
    assert value(microscope, "deflection_voltage") == pytest.approx(state.setpoint, rel=0.05)
    # The scanner rests, at a place within the frame.
    assert microscope.backend.instrument.orders.asked.velocity[0] == pytest.approx(0.0, abs=1e-18)
    assert microscope.scan(size_x=40e-9, pixels=8, lines=2, line_rate=20.0).complete == 1


@pytest.mark.parametrize("after", [0.02, 0.1, 0.25, 0.4])
def test_force_curve_that_is_stopped_brings_its_tip_back_to_the_setpoint(microscope, after):
    curve = {"trigger_force": 20e-9, "approach_rate": 5e-6, "retract_rate": 5e-6, "count": 3}
    outcome = stopped(microscope, after, "force_curve", **curve)
    assert (outcome.status, outcome.message) == (CANCELLED, "ForceCurve was stopped; the tip stays on the sample")
    assert microscope.state.approached
    assert microscope.backend.instrument.in_contact
    assert value(microscope, "deflection_voltage") == pytest.approx(microscope.state.setpoint, rel=0.3)


def test_force_curve_that_is_stopped_over_a_sample_that_is_gone_has_failed_and_its_tip_is_withdrawn(microscope):
    def lower(progress):
        if progress.fraction > 0.05:
            # No rise of the deflection ends the way back.
            microscope.set_setpoint(voltage=9.9)
            microscope.stop(stay=True)

    before = microscope.state.setpoint
    microscope.on_progress = lower
    with pytest.raises(VerbError, match="did not find the sample again; it is withdrawn"):
        microscope.force_curve(trigger_force=10e-9, lift=15e-9, ramp=40e-9, approach_rate=5e-6, retract_rate=5e-6)
    microscope.on_progress = None
    microscope.set_setpoint(voltage=before)
    assert microscope.outcome.status == FAILED
    assert not microscope.state.near


def test_approach_and_move_that_are_stopped_leave_the_tip_where_it_is(microscope):
    microscope.move_to(0.0, 0.0)
    microscope.withdraw()
    outcome = stopped(microscope, 0.05, "approach", rate=2e-6)
    assert outcome.message == "Approach was stopped; the tip stays where it is"
    z = value(microscope, "z")
    outcome = stopped(microscope, 0.2, "move_to", x=300e-9, y=0.0, speed=1e-6)
    assert outcome.message == "MoveTo was stopped; the tip stays where it is"
    assert value(microscope, "z") == z
    assert not microscope.state.approached
    assert 0.0 < microscope.state.place[0] < 300e-9
    microscope.move_to(0.0, 0.0)


def test_verb_that_has_opened_its_loop_and_cannot_close_it_withdraws_the_tip(microscope):
    def on_progress(progress):
        if not microscope.backend.operator._view.follows:
            microscope.stop(stay=True)

    microscope.on_progress = on_progress
    with pytest.raises(VerbError, match="the tip is withdrawn"):
        microscope.lift(size_x=80e-9, pixels=16, lines=64, line_rate=5.0, lift=200e-9, lift_rate=5e-6)
    assert not microscope.state.near


def test_z_moves_while_it_is_held_and_the_loop_brings_the_tip_back_when_it_is_on_again(microscope):
    z = value(microscope, "z")
    with pytest.raises(VerbError, match="MoveZ is not allowed with feedback = on: set it to hold first"):
        microscope.move_z(z=z)
    microscope.set_feedback("hold")
    pressed = value(microscope, "deflection_voltage")
    # On a stiff sample the cantilever bends by all of it, less or more by friction along it.
    microscope.move_z(z=z + 10e-9)
    assert value(microscope, "z") == pytest.approx(z + 10e-9, abs=1e-15)
    rise = value(microscope, "deflection_voltage") - pressed
    assert rise * microscope.backend.operator._view.vertical_sensitivity == pytest.approx(10e-9, rel=0.1)
    assert microscope.state.approached
    microscope.move_z(z=z - 100e-9)
    assert value(microscope, "deflection_voltage") == pytest.approx(0.0, abs=1e-3)
    assert not microscope.state.approached
    microscope.set_feedback("on")
    microscope.read(channels="z", average=0.1)
    assert microscope.state.approached
    assert value(microscope, "z") == pytest.approx(z, abs=2e-9)


def test_withdrawn_tip_moves_along_z_and_its_loop_stays_open(microscope):
    microscope.withdraw()
    z = value(microscope, "z")
    microscope.move_z(z=z - 50e-9)
    assert value(microscope, "z") == pytest.approx(z - 50e-9, abs=1e-15)
    microscope.read(channels="z", average=20e-3)
    assert value(microscope, "z") == pytest.approx(z - 50e-9, abs=1e-15)


def test_hold_keeps_z_at_its_mean_over_the_delay_raised_by_the_lift(microscope):
    z = float(microscope.read(channels="z", average=20e-3)["z"])
    microscope.hold(delay=10e-3, lift=4e-9)
    assert value(microscope, "z") == pytest.approx(z - 4e-9, abs=0.05e-9)
    assert microscope.state.feedback == "hold"
    # However the sample would move, z stays.
    microscope.read(channels="z", average=20e-3)
    assert value(microscope, "z") == pytest.approx(z - 4e-9, abs=0.05e-9)


def test_limits_of_z_bound_loop_and_verbs_and_may_not_exclude_z(microscope):
    z = value(microscope, "z")
    with pytest.raises(ParameterError, match=r"high = .* is not allowed: z = .* is beyond it; move z first"):
        microscope.set_z_limits(high=z - 10e-9)
    microscope.set_z_limits(low=z - 60e-9, high=z + 60e-9)
    try:
        microscope.set_feedback("hold")
        with pytest.raises(VerbError, match=r"z = .* is not allowed: z must be within"):
            microscope.move_z(z=z - 61e-9)
        with pytest.raises(VerbError, match="z less lift"):
            microscope.hold(lift=80e-9)
        with pytest.warns(UserWarning, match="its range ends there"):
            microscope.withdraw(distance=100e-9)
        assert value(microscope, "z") == pytest.approx(z - 60e-9, abs=1e-15)
    finally:
        microscope.set_z_limits(low=-5e-6, high=5e-6)


def test_signals_are_read_at_any_moment_with_their_units(microscope):
    seen = []
    microscope.on_line = lambda line: seen.append(microscope.read_signals("x", "height", "lateral"))
    microscope.scan(size_x=40e-9, pixels=8, lines=2, line_rate=4.0)
    assert len(seen) == 4
    assert {name: each.unit for name, each in seen[0].items()} == {"x": "m", "height": "m", "lateral": "N"}
    assert len({each["x"].value for each in seen}) > 1
    every = microscope.read_signals()
    assert {"z", "deflection", "error", "x", "y", "deflection_voltage"} <= set(every)
    assert every["z"].value == -every["height"].value
    with pytest.raises(ParameterError, match="there is no signal colour; there are "):
        microscope.read_signals("colour")


def test_microscope_can_start_engaged():
    with Microscope("two_materials", engaged=True) as made:
        assert made.state.approached
    assert not made.state.near
