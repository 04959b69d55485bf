"""Whatever happens to a session, what was recorded stays, nothing goes on running, and it says why in a sentence."""

import os
import shlex
import shutil
import signal
import sys
from pathlib import Path

import pytest
from afm_msgs.msg import InstrumentStatus
from support import (
    Command,
    Graph,
    Observer,
    assert_nothing_left,
    executable,
    note_shared_memory,
    processes,
    remove_shared_memory_left,
    session,
    wait_for_the_end_of,
    write_scenario,
)

from afm_bringup.results_folder import ResultsFolder
from afm_recorder_node.reader import read_recording

pytestmark = pytest.mark.long


@pytest.fixture
def endless(tmp_path: Path) -> Path:
    """A scenario that lasts longer than any test."""
    return write_scenario(tmp_path / "endless.yaml", afm_sim_node={"run.duration": 1e4, "plant.control_period": 2e-6})


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


def wait_until_running(command: Command, graph: Graph, ticks: int = 0) -> Observer:
    observer = graph.add(Observer())
    running = InstrumentStatus.RUNNING
    command.wait_until(lambda: observer.status.state == running and observer.recorder.ticks >= ticks, graph)
    note_shared_memory()
    return observer


def flushed(out: Path) -> list[Path]:
    """Recordings, finished or not, in which something stands."""
    return [file for file in out.rglob("*.mcap") if "previous" not in str(file) and file.stat().st_size > 0]


def node(command: Command, name: str) -> int:
    (pid,) = (pid for pid, line in command.descendants.items() if f"/{name} " in line)
    return pid


def test_what_a_killed_recorder_has_written_stays_and_so_does_the_recording_of_the_run_before(
    endless: Path, out: Path, tmp_path: Path
) -> None:
    out.mkdir()
    (out / "recording.rrd").write_text("of the run before")
    (out / "scorecard.json").write_text("of the run before")
    with Graph() as graph, session(endless, out, "--composed", folder=tmp_path) as command:
        wait_until_running(command, graph)
        command.wait_until(lambda: flushed(out), graph)
        os.kill(node(command, "afm_recorder_node"), signal.SIGKILL)
        assert command.wait(graph) == 1, command.text
    assert "error: afm_recorder_node ended with code -9" in command.text
    (kept,) = flushed(out)
    assert kept.parent.parent == out
    assert kept.parent.name.startswith("unfinished-")
    assert f"What was recorded is kept: {kept}" in command.text
    (before,) = out.glob("previous-*")
    assert {file.name: file.read_text() for file in before.iterdir()} == dict.fromkeys(
        ("recording.rrd", "scorecard.json"), "of the run before"
    )
    assert {file.name for file in out.iterdir()} == {"logs", before.name, kept.parent.name}
    remove_shared_memory_left()


STUBBORN = """
import os, signal, time
for number in (signal.SIGINT, signal.SIGHUP):
    signal.signal(number, signal.SIG_IGN)
os.setsid()
while True:
    time.sleep(1)
"""


def test_controller_behind_a_shell_that_ignores_ctrl_c_does_not_outlive_a_killed_session(
    endless: Path, out: Path, tmp_path: Path
) -> None:
    """A child of a shell, in the background, in a process group of its own."""
    program = tmp_path / "stubborn.py"
    program.write_text(STUBBORN)
    shell = shlex.join(["sh", "-c", f"trap '' INT; {shlex.join([sys.executable, str(program)])} & wait"])
    with session(endless, out, "--controller", shell, folder=tmp_path) as command:
        command.wait_until(lambda: any("stubborn.py" in line and "trap" not in line for line in processes().values()))
        # In its own group by now, or on its way there: it is known by what it inherits.
        left = [pid for pid in processes() if pid != command.process.pid]
        note_shared_memory()
        command.process.kill()
        command.process.wait()
        wait_for_the_end_of(left)
        assert processes() == {}
    remove_shared_memory_left()


def test_second_session_with_the_same_folder_is_refused_and_a_closed_terminal_ends_the_first_as_ctrl_c_does(
    endless: Path, out: Path, tmp_path: Path
) -> None:
    with Graph() as graph, session(endless, out, "--composed", folder=tmp_path) as command:
        wait_until_running(command, graph, ticks=500)
        with session(endless, out, "--namespace", "lab2", folder=tmp_path) as second:
            assert second.wait(graph) == 1, second.text
        assert second.text == f"error: another session writes to {out}: choose another folder\n"
        assert not command.ended
        os.kill(command.process.pid, signal.SIGHUP)
        assert command.wait(graph) == 130, command.text
    assert "Traceback" not in command.text
    assert {file.name for file in out.iterdir()} == {"logs", "recording.mcap", "recording.rrd"}
    assert len(read_recording(out / "recording.rrd").time_ticks) > 0
    assert_nothing_left()


def test_session_under_nohup_goes_on_when_the_terminal_is_closed(endless: Path, out: Path, tmp_path: Path) -> None:
    nohup = ("nohup", executable("afm_bringup", "session"), endless, "--composed", "--no-picture", "--out", out)
    with Graph() as graph, Command(*nohup, folder=tmp_path) as command:
        observer = wait_until_running(command, graph)
        os.kill(command.process.pid, signal.SIGHUP)
        # A session that is told to end makes fewer ticks than that.
        ticks = observer.status.ticks + 200_000
        command.wait_until(lambda: observer.status.ticks > ticks, graph)
        assert observer.status.state == InstrumentStatus.RUNNING
        os.kill(command.process.pid, signal.SIGINT)
        assert command.wait(graph) == 130, command.text
    assert_nothing_left()


def test_folder_that_is_removed_while_a_session_runs_is_told(endless: Path, out: Path, tmp_path: Path) -> None:
    with Graph() as graph, session(endless, out, "--composed", folder=tmp_path) as command:
        wait_until_running(command, graph)
        shutil.rmtree(out)
        assert command.wait(graph) == 1, command.text
    assert command.text.strip().splitlines()[-1] == (
        f"error: {out} was removed while the session ran: it has no place for results any more"
    )
    assert "Traceback" not in command.text
    assert processes() == {}


def test_folder_that_was_removed_and_made_again_is_not_the_one_of_the_session(tmp_path: Path) -> None:
    with ResultsFolder(tmp_path / "out") as folder:
        assert folder.there
        shutil.rmtree(tmp_path / "out")
        assert not folder.there
        folder.work.mkdir(parents=True)
        assert not folder.there
