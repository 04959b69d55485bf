"""Verbs over real topics, asked for as any client of ROS 2 does: progress, cancel, refusal, death, the same bytes."""

import gc
import re
import sys
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from afm_msgs.msg import Event
from afm_msgs.srv import Exchange, SetFeedback, SetGains, SetSetpoint
from quick_lever import INSTRUMENT, LAW, PRESSED
from sensor_msgs.msg import Image as ImageMessage
from support import ROOT, Command, Graph, ros_arguments
from verbs_bench import APPROACH, ENDLESS, SCAN, Bench, assert_same, scan_in_process

from afm_model.microscope.image import DIRECTIONS, Image
from afm_model.microscope.verb import all_verbs
from afm_model.microscope.verbs import ForceCurve, MoveTo, ScanPath, Withdraw
from afm_node_common import topics
from afm_node_common.verb_codec import ACTIONS, goal_of, outcome_of, parameters, verb_of
from afm_recorder_node.checks import scan_line


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    with Graph(ros_arguments(INSTRUMENT | LAW)) as graph:
        yield Bench(graph)


def test_instrument_that_was_exchanged_is_freed_without_waiting_for_the_collector(bench: Bench) -> None:
    run = bench.simulator.run
    before = [weakref.ref(one) for one in (run.instrument, run.operator)]
    gc.disable()
    try:
        assert bench.call(Exchange, topics.SET_SAMPLE).success
        assert [one() for one in before] == [None, None]
    finally:
        gc.enable()


@pytest.fixture(scope="module")
def in_process() -> tuple[Image, str]:
    return scan_in_process()


def test_bytes_of_a_scan_over_topics_are_those_in_process(bench: Bench, in_process: tuple[Image, str]) -> None:
    expected, sha = in_process
    heard: list[Any] = []
    bench.client.create_subscription(ImageMessage, f"{topics.IMAGE}/height_trace", heard.append, topics.LATCHED_QOS)
    bench.do(APPROACH)
    result = bench.do(SCAN)
    assert result.scan == 1
    assert (result.lines_done, result.line_rate, result.start) == (2, expected.line_rate, expected.start)
    assert_same(bench.image(SCAN, 1), expected)
    assert bench.simulator.run.instrument.trajectory_sha256() == sha

    def last() -> Any:
        return np.frombuffer(bytes(heard[-1].data), np.float32).reshape(heard[-1].height, heard[-1].width)

    # Those in between are not whole.
    bench.graph.spin_until(lambda: heard and np.isfinite(last()).all())
    # What the recorder makes of a line is the scan that was asked for, in every field.
    assert {scan_line(line).scan for line in bench.lines if line.scan == 1} == {SCAN}
    picture = last()
    # The first row of an Image is the top one.
    np.testing.assert_array_equal(picture[::-1], expected.data["height", DIRECTIONS[0]].astype(np.float32))
    assert (heard[-1].encoding, heard[-1].step) == ("32FC1", 4 * SCAN.pixels)


@pytest.mark.parametrize(
    ("name", "values", "sentence"),
    [
        ("scan", {"size_x": 1.0}, "outside the travel of the scanner"),
        ("scan", {"lines": 0}, "lines = 0 is not allowed: it must be a whole number >= 1"),
        ("scan", {"line_rate": 1e-308}, "line_rate = 1e-308 Hz is not allowed: it must be a finite number >= 1e-07"),
        ("friction_loop", {"count": 100_000}, "count = 100000 is not allowed: it must be"),
        ("scan", {"line_rate": 1e6}, "with pixels = 128: a pixel would be less than a sample"),
        ("scan", {"direction": "sideways"}, "direction = sideways is not allowed: it must be one of up, down"),
        ("move_to", {"x": 1.0}, "x = 1 m is outside the travel of the scanner"),
        ("scan_path", {"x": [0.0, float("nan")], "y": [0.0, 0.0]}, r"x\[1\] = nan m is not allowed"),
        ("approach", {}, "the tip is on the sample already"),
    ],
)
def test_goal_that_cannot_be_is_aborted_in_a_sentence(
    bench: Bench, name: str, values: dict[str, Any], sentence: str
) -> None:
    bench.approach()
    ticks = bench.simulator.run.instrument.ticks
    told = bench.end(bench.ask(name, ACTIONS[name].Goal(**values)))
    assert (told.status, told.result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert re.search(sentence, told.result.message), told.result.message
    assert bench.simulator.run.instrument.ticks == ticks


def test_tip_must_be_approached_and_one_verb_is_done_at_a_time(bench: Bench) -> None:
    bench.do(Withdraw(distance=50e-9))
    told = bench.end(bench.begin(SCAN))
    assert told.result.message == "Scan is not allowed while the tip is withdrawn: it must be approached first"
    bench.approach()
    first = bench.begin(ENDLESS)
    told = bench.end(bench.begin(MoveTo()))
    assert told.status == GoalStatus.STATUS_ABORTED
    assert told.result.message.startswith("MoveTo is not allowed while Scan is being done")
    bench.graph.result(first.cancel_goal_async())
    assert bench.end(first).status == GoalStatus.STATUS_CANCELED


def test_progress_is_told_and_what_is_being_done(bench: Bench) -> None:
    bench.approach()
    heard: list[Any] = []
    events: list[Event] = []
    bench.client.create_subscription(Event, topics.EVENTS, events.append, topics.EVENTS_QOS)
    handle = bench.begin(ENDLESS, lambda message: heard.append(message.feedback))
    bench.graph.spin_until(lambda: len(heard) > 2)
    assert heard[0].progress < heard[-1].progress < 1.0
    assert heard[-1].detail.endswith("of 8000")
    bench.graph.spin_until(lambda: bench.states[-1].doing == "Scan" and bench.states[-1].detail)
    bench.graph.result(handle.cancel_goal_async())
    bench.end(handle)
    bench.graph.spin_until(lambda: bench.states[-1].doing == "")
    assert bench.states[-1].last == "Scan was cancelled; the tip is withdrawn"
    assert not bench.states[-1].approached
    # As its client has asked.
    bench.graph.spin_until(lambda: events and events[-1].text == bench.states[-1].last)
    assert events[-1].level == Event.INFO


def at_once(bench: Bench) -> bool:
    return True


def behind_the_first_lines(bench: Bench) -> bool:
    number = bench.simulator._microscope._lines.number
    return any(line.scan == number and line.index > 1 for line in bench.lines)


@pytest.mark.parametrize("moment", [at_once, behind_the_first_lines])
@pytest.mark.parametrize("times", [1, 2])
def test_cancelled_goal_keeps_what_was_measured_and_leaves_the_tip_withdrawn(
    bench: Bench, moment: Callable[[Bench], bool], times: int
) -> None:
    bench.approach()
    handle = bench.begin(ENDLESS)
    bench.graph.spin_until(lambda: moment(bench))
    for future in [handle.cancel_goal_async() for _ in range(times)]:
        bench.graph.result(future)
    told = bench.end(handle)
    assert (told.status, told.result.success) == (GoalStatus.STATUS_CANCELED, False)
    assert told.result.message == "Scan was cancelled; the tip is withdrawn"
    assert told.result.scan == bench.simulator._microscope._lines.number > 0
    assert told.result.lines_done >= (2 if moment is behind_the_first_lines else 0)
    assert not bench.near
    assert not bench.simulator.run.instrument.in_contact


def test_cancel_that_comes_when_the_last_line_is_measured_withdraws_the_tip(bench: Bench) -> None:
    bench.approach()
    handle = bench.begin(SCAN)
    run = bench.simulator.run
    # Without the executor: the verb comes to its end, and nobody has been told.
    while run.operator.busy:
        bench.simulator.step()
    bench.graph.result(handle.cancel_goal_async())
    told = bench.end(handle)
    bench.graph.spin_until(lambda: not run.operator.busy)
    # Either the cancel was first, or the result.
    if told.status == GoalStatus.STATUS_CANCELED:
        assert told.result.message == "Scan was cancelled at its end; the tip is withdrawn"
        assert not bench.near
    else:
        assert told.status == GoalStatus.STATUS_SUCCEEDED
    assert told.result.lines_done == SCAN.lines


def test_settings_act_between_ticks_and_stand_in_the_parameters(bench: Bench) -> None:
    set_to = bench.call(SetSetpoint, topics.SET_SETPOINT, force=12e-9)
    assert (set_to.success, set_to.force) == (True, pytest.approx(12e-9))
    both = bench.call(SetSetpoint, topics.SET_SETPOINT, force=1e-9, voltage=1.0)
    assert (both.success, both.force) == (False, pytest.approx(12e-9))
    assert "give one of them" in both.message
    nothing = bench.call(SetSetpoint, topics.SET_SETPOINT)
    assert (nothing.success, nothing.force) == (True, 0.0)
    far = bench.call(SetSetpoint, topics.SET_SETPOINT, force=10.0)
    assert (far.success, far.force) == (False, 0.0)
    assert "the detector saturates at 50 V" in far.message
    assert bench.call(SetSetpoint, topics.SET_SETPOINT, force=12e-9).success
    loud = bench.call(SetGains, topics.SET_GAINS, integral=40e-6)
    assert loud.success and "makes the z loop oscillate" in loud.message
    assert bench.call(SetGains, topics.SET_GAINS, integral=12e-6).success
    assert not bench.call(SetFeedback, topics.SET_FEEDBACK, mode="loud").success
    assert bench.call(SetFeedback, topics.SET_FEEDBACK, mode="hold").success
    value = bench.simulator.get_parameter
    assert value("onboard.setpoint_force").value == pytest.approx(12e-9)
    assert value("onboard.integral_gain").value == 12e-6
    bench.graph.spin_until(lambda: bench.states[-1].feedback == "hold")
    assert bench.states[-1].setpoint_force == pytest.approx(12e-9)
    # What ros2cli sends of "{mode: off}" and "{mode: on}".
    assert bench.call(SetFeedback, topics.SET_FEEDBACK, mode="False").success
    bench.graph.spin_until(lambda: bench.states[-1].feedback == "off")
    assert bench.call(SetFeedback, topics.SET_FEEDBACK, mode="True").success
    bench.graph.spin_until(lambda: bench.states[-1].feedback == "on")
    bench.call(SetSetpoint, topics.SET_SETPOINT, force=10e-9)
    bench.call(SetGains, topics.SET_GAINS, integral=10e-6)


def test_force_curves_come_whole(bench: Bench) -> None:
    bench.approach()
    verb = ForceCurve(lift=100e-9, ramp=200e-9, approach_rate=5e-6, retract_rate=5e-6, trigger_force=20e-9)
    outcome = outcome_of(verb, bench.do(verb), cancelled=False)
    curve = outcome.result[0]
    assert (len(outcome.result), curve.triggered, curve.approach_rate) == (1, True, 5e-6)
    assert set(curve.record.channels) == {"z", "deflection_voltage", "lateral_voltage", "phase"}
    assert len(curve.record.time) == len(curve.record.channels["z"]) > 1000


LEASE = """<rtps><builtin><discovery_config>
<leaseDuration><sec>2</sec></leaseDuration><leaseAnnouncement><sec>1</sec></leaseAnnouncement>
</discovery_config></builtin>"""
"""The middleware misses a killed process of this profile after 2 s in place of 20."""


def test_client_that_is_killed_leaves_the_tip_withdrawn_and_is_told(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    profile = (ROOT / "afm_bringup" / "config" / "loopback.xml").read_text()
    (tmp_path / "lease.xml").write_text(profile.replace("<rtps>", LEASE))
    for name in ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE"):  # new and old
        monkeypatch.setenv(name, str(tmp_path / "lease.xml"))
    bench.approach()
    with Command(sys.executable, Path(__file__).with_name("one_goal.py"), folder=tmp_path) as process:
        process.wait_until(lambda: bench.simulator.run.operator.busy, bench.graph)
        bench.graph.spin_until(lambda: behind_the_first_lines(bench))
        # What is left running is killed with SIGKILL here.
    bench.graph.spin_until(lambda: not bench.simulator.run.operator.busy)
    assert not bench.near
    bench.graph.spin_until(lambda: bench.states[-1].doing == "")
    assert bench.states[-1].last == "Scan was cancelled, because its client has gone; the tip is withdrawn"
    events: list[Event] = []
    bench.client.create_subscription(Event, topics.EVENTS, events.append, topics.EVENTS_QOS)
    bench.graph.spin_until(lambda: events and events[-1].text == bench.states[-1].last)
    assert events[-1].level == Event.WARN


def test_another_sample_begins_anew_with_the_tip_withdrawn_only(bench: Bench) -> None:
    bench.approach()
    told = bench.call(Exchange, topics.SET_SAMPLE, parameters=parameters({"width": 2.0e-8}))
    assert (told.success, "withdraw it first" in told.message) == (False, True)
    bench.do(Withdraw(distance=50e-9))
    told = bench.call(Exchange, topics.SET_SAMPLE, parameters=parameters({"width": -1}))
    assert (told.success, "sample.width = -1" in told.message) == (False, True)
    told = bench.call(Exchange, topics.SET_SAMPLE, parameters=parameters({"kind": "flat", "height": 0.0}))
    assert not told.success
    told = bench.call(Exchange, topics.SET_SAMPLE, parameters=parameters({"kind": "flat"}))
    assert (told.success, told.message) == (True, "")
    assert bench.simulator.get_parameter("sample.kind").value == "flat"
    assert not bench.simulator.has_parameter("sample.width")
    bench.do(APPROACH)
    assert bench.do(SCAN).lines_done == SCAN.lines


def test_calibrations_are_put_in_use_while_the_tip_is_on_the_sample(bench: Bench) -> None:
    bench.approach()

    def use(**values: float | str) -> Any:
        return bench.call(Exchange, topics.SET_CALIBRATION, parameters=parameters(values))

    told = use(spring_constant=0.24)
    assert (told.success, told.message) == (True, "")
    assert bench.simulator.get_parameter("calibration.spring_constant").value == 0.24
    # The setpoint is a force: it is one by what is believed.
    assert bench.simulator.run.operator.state.setpoint == pytest.approx(PRESSED / 1.2)
    for name, value, sentence in (
        ("self", 1.0, "self is no calibration: there are spring_constant, deflection_sensitivity"),
        ("spring_constant", "soft", "calibration.spring_constant = soft"),
    ):
        told = bench.call(Exchange, topics.SET_CALIBRATION, parameters=parameters({name: value}))
        assert (told.success, sentence in told.message) == (False, True), told.message
    assert use(spring_constant=0.0).success
    assert bench.simulator.run.operator.state.setpoint == pytest.approx(PRESSED)


def test_verbs_are_told_as_events_and_what_counts_their_steps_is_no_topic(bench: Bench) -> None:
    told: list[Event] = []
    bench.client.create_subscription(Event, topics.EVENTS, told.append, topics.EVENTS_QOS)
    bench.approach()
    begun, done = bench.simulator.run.instrument.ticks, bench.do(Withdraw(distance=50e-9))
    ticks = bench.simulator.run.instrument.ticks
    # Of the verbs before it is told, too.
    bench.graph.spin_until(lambda: told and (told[-1].text, told[-1].tick) == ("Withdraw was done", ticks))
    assert (told[-2].text, told[-2].tick) == ("Withdraw has begun", begun)
    assert {event.level for event in told} == {Event.INFO}
    assert begun < ticks
    assert done.time == pytest.approx(bench.simulator.run.instrument.time, abs=1e-3)
    published = {name for name, _ in bench.client.get_topic_names_and_types()}
    channels = {channel.name for channel in bench.simulator.run.instrument.channels}
    assert {"verb_number", "verb_step"} < channels
    assert {f"/afm/{name}" for name in channels} - published == {"/afm/verb_number", "/afm/verb_step"}


def test_goals_say_what_verbs_say_in_every_field() -> None:
    for name, verb in all_verbs().items():
        if name not in ACTIONS:  # asked for by the action `verb`
            continue
        goal = ACTIONS[name].Goal()
        assert set(goal.get_fields_and_field_types()) == set(verb.model_fields), name
        assert verb_of(name, goal) == verb(), name
        assert verb_of(name, goal_of(verb())) == verb(), name
    path = ScanPath(x=(0.0, 1e-9), y=(0.0, 2e-9))
    assert verb_of("scan_path", goal_of(path)) == path
