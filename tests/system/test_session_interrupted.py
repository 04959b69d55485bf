"""However a session is cut short, it leaves nothing running and nothing half-finished under a final name."""

import json
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from afm_msgs.msg import InstrumentStatus
from hand_controller import HandController
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from support import (
    Command,
    Graph,
    Observer,
    assert_nothing_left,
    note_shared_memory,
    processes,
    remove_shared_memory_left,
    session,
    wait_for_the_end_of,
    write_scenario,
)

from afm_node_common import topics
from afm_recorder_node.reader import read_recording
from afm_sim_node.node import SimNode

RESULTS = {"recording.mcap", "recording.rrd", "overview.png", "scorecard.json"}
CONTROL_PERIOD = 2e-6


@pytest.fixture
def endless(tmp_path: Path) -> Path:
    """A scenario that lasts longer than any test, law.alpha 20."""
    return write_scenario(
        tmp_path / "endless.yaml", afm_sim_node={"run.duration": 1000.0, "plant.control_period": CONTROL_PERIOD}
    )


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


def left_in(out: Path) -> set[str]:
    """What stands in the folder of the results beside logs."""
    return {file.name for file in out.iterdir()} - {"logs"} if out.exists() else set()


def assert_recording_is_kept(out: Path, command: Command | None = None) -> None:
    """Nothing stands under a final name, and what was recorded does where a person finds it."""
    (name,) = left_in(out)
    assert name.startswith("unfinished-")
    recording = out / name / "recording.mcap"
    assert len(read_recording(recording).time_ticks) > 0
    assert command is None or f"What was recorded is kept: {recording}" in command.text


# Ctrl-C.


def test_ctrl_c_while_the_session_itself_is_loading_ends_it_without_a_traceback(
    endless: Path, out: Path, tmp_path: Path
) -> None:
    with session(endless, out, folder=tmp_path) as command:
        # numpy is there, so python runs; whether anything else is does not matter.
        command.wait_until(lambda: "numpy" in Path(f"/proc/{command.process.pid}/maps").read_text())
        code = command.interrupt_again_and_again()
    assert code == 130, command.told
    assert "Traceback" not in command.text
    assert left_in(out) == set()
    assert_nothing_left()


@pytest.mark.long
def test_ctrl_c_before_the_nodes_are_up_leaves_nothing(endless: Path, out: Path, tmp_path: Path) -> None:
    with session(endless, out, folder=tmp_path) as command:
        command.wait_until(lambda: len(command.descendants) == 4)
        command.interrupt()
        assert command.wait() == 130, command.text
    assert "Traceback" not in command.text
    assert left_in(out) == set()
    assert_nothing_left()


@pytest.mark.long
def test_ctrl_c_just_after_the_start_leaves_a_readable_recording_if_any(
    endless: Path, out: Path, tmp_path: Path
) -> None:
    with Graph() as graph, session(endless, out, "--composed", folder=tmp_path) as command:
        observer = graph.add(Observer())
        command.wait_until(lambda: observer.status.state == InstrumentStatus.RUNNING, graph)
        code = command.interrupt_again_and_again(graph)
    assert code == 130, command.text
    assert "Traceback" not in command.text
    assert left_in(out) <= {"recording.mcap", "recording.rrd"}
    if left_in(out):
        recording = read_recording(out / "recording.rrd")
        assert len(recording.time_samples) == 2 * len(recording.time_ticks) > 0
    assert_nothing_left()


def test_ctrl_c_in_the_middle_leaves_the_recording_up_to_there_with_every_change_of_a_parameter(
    endless: Path, out: Path, tmp_path: Path
) -> None:
    out.mkdir()
    for stale in ("overview.png", "scorecard.json"):
        (out / stale).write_text("of an older run")
    with Graph() as graph, session(endless, out, folder=tmp_path) as command:
        observer = graph.add(Observer())
        controller, simulator = (
            AsyncParameterClient(observer, f"/afm/{name}") for name in ("afm_controller_node", "afm_sim_node")
        )

        def wait_for_ticks(more: int) -> int:
            """Wait for two reports beyond `more` ticks from now; those of the first of them."""
            goal = observer.status.ticks + more
            command.wait_until(lambda: observer.status.ticks >= goal, graph)
            first = observer.status.ticks
            command.wait_until(lambda: observer.status.ticks > first, graph)
            return first

        def change(client: AsyncParameterClient, name: str, value: object) -> tuple[bool, str]:
            command.wait_until(client.services_are_ready, graph)
            future = client.set_parameters([Parameter(name, value=value).to_parameter_msg()])
            command.wait_until(future.done, graph)
            (result,) = future.result().results
            return result.successful, result.reason

        before = wait_for_ticks(500)
        assert change(controller, "law.alpha", 5.0) == (True, "")
        wait_for_ticks(500)
        changed, reason = change(controller, "law.alpha", -1.0)
        assert not changed
        assert reason == "law.alpha = -1.0 is not allowed: it must be a finite number >= 1e-12 and <= 1e+12"
        for client, name, value in ((controller, "scanner.mass_ratio", 50.0), (simulator, "plant.dt", 1e-7)):
            changed, reason = change(client, name, value)
            assert not changed
            assert name in reason
            assert "read-only" in reason
        seen = wait_for_ticks(500)
        command.interrupt()
        assert command.wait(graph) == 130, command.text
    assert "Traceback" not in command.text
    assert str(out / "recording.rrd") in command.text
    assert left_in(out) == {"recording.mcap", "recording.rrd"}
    recording = read_recording(out / "recording.rrd")
    assert len(recording.time_ticks) >= seen
    assert len(recording.time_samples) == 2 * len(recording.time_ticks)
    (change_,) = recording.parameter_changes
    assert (change_.node, change_.name, change_.old, change_.new) == ("afm_controller_node", "law.alpha", 10.0, 5.0)
    assert before * CONTROL_PERIOD <= change_.time <= recording.time_ticks[-1]
    assert_nothing_left()


def test_score_names_the_law_and_the_gains_that_were_in_force_and_each_change(out: Path, tmp_path: Path) -> None:
    duration = 0.2
    scenario = write_scenario(
        tmp_path / "changing.yaml",
        afm_sim_node={"run.duration": duration, "plant.control_period": 2e-6, "score.start": 0.0},
        afm_controller_node={"law.kind": "tanh", "law.alpha": 8.0},
    )
    with Graph() as graph, session(scenario, out, "--composed", folder=tmp_path) as command:
        observer = graph.add(Observer())
        client = AsyncParameterClient(observer, "/afm/afm_controller_node")
        # The services, which may take seconds to be found, are there before the run begins.
        command.wait_until(client.services_are_ready, graph)
        command.wait_until(lambda: observer.status.ticks > 0, graph)
        assert observer.call(graph, topics.PAUSE).success
        command.wait_until(lambda: observer.recorder.ticks > 0, graph)
        future = client.set_parameters([Parameter("law.kind", value="sgn").to_parameter_msg()])
        command.wait_until(future.done, graph)
        assert observer.call(graph, topics.PLAY).success
        assert command.wait(graph) == 0, command.text
    card = json.loads((out / "scorecard.json").read_text())
    assert card["controller"] == "tanh then sgn"
    assert card["law"]["parameters"]["law.alpha"] == 8.0
    (change,) = card["law"]["changes"]
    assert (change["name"], change["old"], change["new"]) == ("law.kind", "tanh", "sgn")
    assert 0.0 < change["time_s"] < duration
    assert "law.kind changed from tanh to sgn" in command.text
    assert (card["valid"], "rests" in card["reason"]) == (False, True)  # sgn chatters
    assert_nothing_left()


# Worse.


@contextmanager
def under_way(scenario: Path, out: Path, folder: Path, *options: str) -> Iterator[tuple[Graph, Command]]:
    """A session in the middle of its run, of which the recorder has received a part, with what it uses noted."""
    with Graph() as graph, session(scenario, out, *options, folder=folder) as command:
        observer = graph.add(Observer())
        command.wait_until(lambda: observer.recorder.ticks > 500, graph)
        note_shared_memory()
        yield graph, command


def test_session_beside_another_instrument_is_refused(out: Path, tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path / "short.yaml", afm_sim_node={"run.duration": 0.001})
    with Graph() as graph:
        observer = graph.add(Observer())
        graph.add(SimNode())
        graph.spin_until(lambda: observer.statuses)
        with session(scenario, out, folder=tmp_path) as command:
            assert command.wait(graph) == 1, command.text
        assert "error: another instrument" in command.text
        assert "Traceback" not in command.text
        assert observer.status.state != InstrumentStatus.FAULT
    assert left_in(out) == set()
    assert_nothing_left()


def test_second_controller_ends_the_session_and_is_told(endless: Path, out: Path, tmp_path: Path) -> None:
    with under_way(endless, out, tmp_path, "--composed") as (graph, command):
        graph.add(HandController(lambda measurement: [], "intruder"))
        assert command.wait(graph) == 1, command.text
    assert "error: another controller runs on /afm" in command.text
    assert "Traceback" not in command.text
    assert_recording_is_kept(out, command)
    assert_nothing_left()


@pytest.mark.long
def test_session_killed_outright_leaves_no_node_running_and_nothing_under_a_final_name(
    endless: Path, out: Path, tmp_path: Path
) -> None:
    with under_way(endless, out, tmp_path) as (_, command):
        nodes = list(command.descendants)
        assert len(nodes) == 4  # with the one that is to end the others
        command.process.kill()
        command.process.wait()
        wait_for_the_end_of(nodes)
        assert processes() == {}
    assert left_in(out) & RESULTS == set()
    assert_recording_is_kept(out)
    # The session itself had no chance to remove its own.
    remove_shared_memory_left()


def test_node_that_dies_is_named_and_nothing_stands_under_a_final_name(
    endless: Path, out: Path, tmp_path: Path
) -> None:
    out.mkdir()
    (out / "scorecard.json").write_text("of an older run")
    with under_way(endless, out, tmp_path) as (graph, command):
        (victim,) = (pid for pid, line in command.descendants.items() if "/afm_sim_node " in line)
        os.kill(victim, signal.SIGKILL)
        assert command.wait(graph) == 1, command.text
        assert processes() == {}
    assert "error: afm_sim_node ended with code -9" in command.text
    assert "Traceback" not in command.text
    assert_recording_is_kept(out, command)
    assert processes() == {}
    # The session removes what the killed node had; peers that still believe in it may make its ports anew.
    remove_shared_memory_left()
