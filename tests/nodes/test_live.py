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
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader
from support import TIMEOUT, Command, assert_nothing_left, executable, processes, session, write_scenario

from afm_model import ControllerParameters, SimParameters, build, simulate
from afm_recorder_node import layout
from afm_recorder_node.frames import HEADER, split
from afm_recorder_node.live import RERUN, follow
from afm_recorder_node.writer import RecordingWriter

ROWS = 1000
SIMULATOR = {"run.duration": 0.02, "plant.control_period": 2e-6}


def write(writer: RecordingWriter, block: int) -> None:
    """A block of rows of one channel."""
    writer.channel(layout.DEFLECTION, block * ROWS, 1e-3, np.zeros(ROWS))
    writer.flush()


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
    path = tmp_path / "run.rrd"
    with closing(RecordingWriter(path)) as first, live(path) as page:
        write(first, 0)
        assert b"<html" in urllib.request.urlopen(page.text.partition("?")[0].strip()).read().lower()
        with viewer(page.text, tmp_path) as client:
            # What was there before it came, what comes, and what comes behind a reset.
            client.wait_until(lambda: got(tmp_path) == [ROWS])
            write(first, 1)
            client.wait_until(lambda: got(tmp_path) == [2 * ROWS])
            first.close()
            with closing(RecordingWriter(path)) as second:
                write(second, 0)
                client.wait_until(lambda: got(tmp_path) == [ROWS, 2 * ROWS])
                # A server that is killed takes the page with it, and nothing else.
                os.kill(server(), signal.SIGKILL)
                write(second, 1)
                assert page.wait() == 1, page.told
                assert not second.problem


def test_live_page_says_in_a_terminal_what_it_waits_for(tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    with closing(RecordingWriter(path)) as writer:
        write(writer, 0)
    ours, its = os.openpty()
    with subprocess.Popen([executable("afm_recorder_node", "live"), path], stderr=its) as page:
        with open(ours) as terminal:
            os.close(its)
            told = terminal.readline()
        page.terminate()
    assert told == f"waiting until {tmp_path / 'run.partial.rrd'} grows; {path} is complete: `view` shows it\n"


def test_live_page_ends_in_order_and_leaves_no_server(tmp_path: Path) -> None:
    with closing(RecordingWriter(tmp_path / "run.rrd")), live(tmp_path / "run.rrd") as page:
        page.interrupt()
        assert page.wait() == 0, page.told
    assert_nothing_left()
    with closing(RecordingWriter(tmp_path / "run.rrd")), live(tmp_path / "run.rrd") as page:
        page.process.kill()
        page.wait()
    assert_nothing_left()


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


def test_run_whose_file_has_the_inode_of_the_one_before_is_followed_too(tmp_path: Path) -> None:
    # A file system gives it again as soon as it is free.
    growing, messages = tmp_path / "run.partial.rrd", follow(tmp_path / "run.rrd")
    with closing(RecordingWriter(tmp_path / "other.rrd")) as writer:
        write(writer, 0)
        growing.write_bytes((tmp_path / "other.partial.rrd").read_bytes())
    first = b"".join(iter(lambda: next(messages), b""))
    assert len(first) > HEADER
    growing.rename(tmp_path / "run-2.partial.rrd")
    assert next(messages) == b""
    assert b"".join(iter(lambda: next(messages), b"")) == first[HEADER:]


def test_page_gets_other_ports_if_somebody_has_taken_those_that_were_free(tmp_path: Path) -> None:
    with socket.socket() as taken, closing(RecordingWriter(tmp_path / "run.rrd")) as writer:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        write(writer, 0)
        # As if it had been taken since it was looked at.
        looks = f"free = live._free; live._free = lambda wanted: {port} if wanted else free(0)"
        program = f"from afm_recorder_node import live; {looks}; raise SystemExit(live.main())"
        with Command(sys.executable, "-c", program, tmp_path / "run.rrd", folder=tmp_path) as page:
            page.wait_until(lambda: "/proxy" in page.text)
            assert str(port) not in page.text.partition("http://")[2]
            page.interrupt()
            assert page.wait() == 0, page.told
    assert_nothing_left()


@pytest.mark.long
def test_memory_is_bounded_while_a_viewer_reads_nothing_of_1500_megabytes(tmp_path: Path) -> None:
    stream = rr.RecordingStream(layout.APPLICATION)
    encoded = rr.binary_stream(stream)
    head = encoded.read() or b""
    rows = np.random.default_rng(0).random(32_768)
    times = [rr.TimeColumn("t", sequence=np.arange(len(rows)))]
    stream.send_columns("/other", times, rr.Scalars.columns(scalars=rows))
    block = b"".join(split(encoded.read() or b""))
    stream.send_columns(layout.DEFLECTION.entity, times, rr.Scalars.columns(scalars=rows))
    last = b"".join(split(encoded.read() or b""))
    growing = tmp_path / "run.partial.rrd"
    growing.write_bytes(head[:HEADER] + b"".join(split(head)) + block)
    later = tmp_path / "later"
    later.mkdir()
    with live(tmp_path / "run.rrd") as page, viewer(page.text, tmp_path) as client:
        client.wait_until(lambda: got(tmp_path))
        client.process.send_signal(signal.SIGSTOP)
        with growing.open("ab") as file:
            for _ in range(1_500_000_000 // len(block)):
                file.write(block)
            file.write(last)
        with viewer(page.text, later) as second:
            # What comes last has come: all has gone through the server.
            second.wait_until(lambda: got(later) == [len(rows)], timeout=5 * TIMEOUT)
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
        assert (out / "scorecard.json").exists() and (out / "recording.rrd").exists()
        link = re.search(r"http://127.0.0.1:\d+", text)
        assert link and urllib.request.urlopen(link[0], timeout=TIMEOUT).status == 200
        assert not any("afm_recorder_node/afm_recorder_node" in line for line in processes().values())
        running.send_signal(signal.SIGINT)
        assert running.wait() == 0
    os.close(ours)
    assert_nothing_left()
