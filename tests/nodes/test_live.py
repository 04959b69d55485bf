"""The live page: what viewers get of a growing recording, and that none of them reaches the recorder or the loop."""

import json
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
import urllib.request
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from recorded import begin, put, waveform
from rerun.chunk import RrdReader
from support import TIMEOUT, Command, assert_nothing_left, executable, processes, session, write_scenario

from afm_model import ControllerParameters, SimParameters, build, simulate
from afm_recorder_node import layout
from afm_recorder_node.live import RERUN, follow
from afm_recorder_node.record_writer import RecordWriter

ROWS = 1000
SIMULATOR = {"run.duration": 0.02, "plant.control_period": 2e-6}


def write(writer: RecordWriter, block: int) -> None:
    """A block of rows of one channel."""
    put(writer, [("deflection", waveform(block * ROWS, np.zeros(ROWS), period=1e-3))])


@contextmanager
def live(path: Path) -> Iterator[Command]:
    """The live page of a recording, when its link is there."""
    with Command(executable("afm_recorder_node", "live"), path, folder=path.parent) as page:
        page.wait_until(lambda: "/proxy" in page.text)
        yield page


@contextmanager
def viewer(told: str, folder: Path) -> Iterator[Command]:
    """A client of rerun's own, which saves what it gets in got.rrd."""
    address = re.search(r"rerun\+http://127\.0\.0\.1:\d+/proxy", told)
    assert address, told
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    own = ("--bind", "127.0.0.1", "--port", str(port), "--save", folder / "got.rrd")
    with Command(RERUN, address[0], *own, folder=folder) as client:
        yield client


def got(folder: Path) -> list[int]:
    """Rows of the channel that the client has saved, of each recording."""
    found = []
    with warnings.catch_warnings(), suppress(RuntimeError, ValueError, OSError):
        warnings.simplefilter("ignore", rr.error_utils.RerunWarning)
        reader = RrdReader(folder / "got.rrd")
        for store in reader.recordings():
            found.append(0)
            for chunk in reader.stream(store=store):
                found[-1] += chunk.num_rows * (chunk.entity_path == layout.DEFLECTION.entity and not chunk.is_static)
    return sorted(found)


def server() -> int:
    """Process of rerun's server."""
    (pid,) = (pid for pid, line in processes().items() if line.startswith(RERUN) and "--serve-web" in line)
    return pid


def test_viewer_gets_the_recording_as_it_grows_and_that_of_the_next_run(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    first = begin(path, [])
    with live(path) as page:
        write(first, 0)
        assert b"<html" in urllib.request.urlopen(page.text.partition("?")[0].strip()).read().lower()
        with viewer(page.text, tmp_path) as client:
            # What was there before it came, what comes, and what comes after a reset.
            client.wait_until(lambda: got(tmp_path) == [ROWS])
            write(first, 1)
            client.wait_until(lambda: got(tmp_path) == [2 * ROWS])
            second = begin(tmp_path / "run-2.mcap", [])
            write(second, 0)
            # The end of the run before comes late.
            write(first, 2)
            first.close({"missing": ""})
            client.wait_until(lambda: got(tmp_path) == [ROWS, 3 * ROWS])
            # A server that is killed takes the page with it, and nothing else.
            os.kill(server(), signal.SIGKILL)
            write(second, 1)
            assert page.wait() == 1, page.told
            assert not second.file.problem
    second.close({})


def test_live_page_says_in_a_terminal_what_it_waits_for(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    begin(path, []).close({})
    ours, its = os.openpty()
    with subprocess.Popen([executable("afm_recorder_node", "live"), path], stderr=its) as page:
        with open(ours) as terminal:
            os.close(its)
            told = terminal.readline()
        page.terminate()
    assert told == f"waiting until {path} grows; {path} does not grow any more: `view` shows it\n"


def test_live_page_ends_in_order_and_leaves_no_server(tmp_path: Path) -> None:
    writer = begin(tmp_path / "run.mcap", [])
    write(writer, 0)
    with live(tmp_path / "run.mcap") as page:
        page.interrupt()
        assert page.wait() == 0, page.told
    assert_nothing_left()
    with live(tmp_path / "run.mcap") as page:
        page.process.kill()
        page.wait()
    assert_nothing_left()
    writer.close({})


@pytest.mark.long
def test_session_ends_with_the_same_bits_behind_a_viewer_and_a_server_that_stand_still(tmp_path: Path) -> None:
    scenario, go = write_scenario(tmp_path / "short.yaml", afm_sim_node=SIMULATOR), tmp_path / "go"
    # The run begins when both stand still: it has a controller from then on.
    node = executable("afm_controller_node", "afm_controller_node")
    later = shlex.join(["sh", "-c", f'until [ -e {go} ]; do sleep 0.05; done; exec {node} "$@"', "sh"])
    with session(scenario, tmp_path / "out", "--live", "--controller", later, folder=tmp_path) as command:
        command.wait_until(lambda: "/proxy" in command.text)
        with viewer(command.text, tmp_path) as client:
            client.wait_until(lambda: got(tmp_path))
            client.process.send_signal(signal.SIGSTOP)
            os.kill(server(), signal.SIGSTOP)
            go.touch()
            assert command.wait() == 0, command.told
    card = json.loads((tmp_path / "out" / "scorecard.json").read_text())
    expected = simulate(build(SimParameters, SIMULATOR), ControllerParameters())
    assert card["trajectory_sha256"] == expected.trajectory_sha256
    assert_nothing_left()


def everything(stream: Iterator[bytes]) -> bytes:
    """What a follower gives until there is nothing new."""
    return b"".join(iter(lambda: next(stream), b""))


def test_records_that_grow_are_followed_and_those_that_were_there_before_are_not(tmp_path: Path) -> None:
    old = begin(tmp_path / "run.mcap", [])
    write(old, 0)
    old.close({})
    stream = follow(tmp_path / "run.mcap")
    assert everything(stream) == b""
    # One that has come and ended between two looks is new; one of another name is not ours.
    for name in ("run-2.mcap", "run-b.mcap"):
        writer = begin(tmp_path / name, [])
        write(writer, 0)
        writer.close({})
    assert everything(stream).count(b"RRF2FOOT") == 1
    # As is a file that gets the name of one that was removed.
    (tmp_path / "run-2.mcap").unlink()
    assert everything(stream) == b""
    write(begin(tmp_path / "run-2.mcap", []), 0)
    assert everything(stream)


def test_damaged_record_is_told_and_the_next_one_is_followed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stream = follow(tmp_path / "run.mcap")
    assert everything(stream) == b""
    first = begin(tmp_path / "run.mcap", [])
    write(first, 0)
    with (tmp_path / "run.mcap").open("r+b") as file:
        file.seek(-300, os.SEEK_END)
        file.write(b"spoiled")
    everything(stream)
    assert f"{tmp_path / 'run.mcap'} is damaged" in capsys.readouterr().err
    write(begin(tmp_path / "run-2.mcap", []), 0)
    assert everything(stream)


def test_page_gets_other_ports_if_somebody_has_taken_those_that_were_free(tmp_path: Path) -> None:
    writer = begin(tmp_path / "run.mcap", [])
    write(writer, 0)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        # As if it had been taken since it was looked at.
        looks = f"free = live._free; live._free = lambda wanted: {port} if wanted else free(0)"
        program = f"from afm_recorder_node import live; {looks}; raise SystemExit(live.main())"
        with Command(sys.executable, "-c", program, tmp_path / "run.mcap", folder=tmp_path) as page:
            page.wait_until(lambda: "/proxy" in page.text)
            assert str(port) not in page.text.partition("http://")[2]
            page.interrupt()
            assert page.wait() == 0, page.told
    assert_nothing_left()


@pytest.mark.long
def test_memory_is_bounded_while_a_viewer_reads_nothing_of_a_long_run(tmp_path: Path) -> None:
    noise, growing = np.random.default_rng(0).random(32_768), tmp_path / "run.mcap"
    writer = begin(growing, [])
    begun = growing.stat().st_size
    put(writer, (("other", waveform(k * len(noise), noise)) for k in range(32)))
    block = growing.read_bytes()[begun:]
    later = tmp_path / "later"
    later.mkdir()
    with live(growing) as page, viewer(page.text, tmp_path) as client:
        client.wait_until(lambda: got(tmp_path))
        client.process.send_signal(signal.SIGSTOP)
        # 13 million samples, of each of which rerun makes some 30 bytes.
        for _ in range(100_000_000 // len(block)):
            writer.file.write(block)
        write(writer, 0)
        with viewer(page.text, later) as second:
            # What comes last has come: all has gone through the server.
            second.wait_until(lambda: got(later) == [ROWS], timeout=5 * TIMEOUT)
        assert most(server()) < 1e9
        assert most(page.process.pid) < 3e8


def most(pid: int) -> int:
    """Largest resident memory that a process has had [bytes]."""
    return 1024 * int(Path(f"/proc/{pid}/status").read_text().partition("VmHWM:")[2].split(maxsplit=1)[0])


def test_page_of_a_session_in_a_terminal_stays_after_a_short_run_until_ctrl_c(tmp_path: Path) -> None:
    scenario, out = write_scenario(tmp_path / "short.yaml", afm_sim_node=SIMULATOR), tmp_path / "out"
    ours, its = os.openpty()
    command = [executable("afm_bringup", "session"), scenario, "--out", out, "--live", "--composed", "--no-picture"]
    with subprocess.Popen(command, stderr=its, stdout=subprocess.DEVNULL, start_new_session=True) as running:
        os.close(its)
        text = ""
        while "The live page stays until Ctrl-C." not in text:
            text += os.read(ours, 65536).decode()
        # The results are there, the nodes have ended, and the page is served.
        assert (out / "scorecard.json").exists() and (out / "recording.mcap").exists()
        link = re.search(r"http://127.0.0.1:\d+", text)
        assert link and urllib.request.urlopen(link[0], timeout=TIMEOUT).status == 200
        assert not any("afm_recorder_node/afm_recorder_node" in line for line in processes().values())
        running.send_signal(signal.SIGINT)
        assert running.wait() == 0
    os.close(ours)
    assert_nothing_left()
