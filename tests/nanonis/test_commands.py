"""Claims about the server of the protocol in front of a microscope on topics, and about both commands."""

import re
import signal
import socket
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from support import Command, executable

from afm_model import load_scenario
from afm_model.files import read_scan
from afm_nanonis.command import main

from .client import Client


@pytest.fixture
def client(tmp_path: Path) -> Iterator[Client]:
    folder = tmp_path
    scenario = load_scenario("two_materials").path
    simulator = [executable("afm_sim_node", "afm_sim_node"), "--ros-args", "--params-file", str(scenario)]
    simulator += ["-p", "law.kind:=pid", "-p", "run.mode:=realtime", "-p", "run.real_time_factor:=0.5"]
    server = [executable("afm_nanonis", "server"), "two_materials", "--engaged", "--ports", "0,0"]
    server += ["--stream-port", "0", "--out", str(folder / "session")]
    with ExitStack() as stack:
        sim = stack.enter_context(Command(*simulator, folder=folder))
        sim.wait_until(lambda: "running" in sim.text)
        serving = stack.enter_context(Command(*server, folder=folder))
        serving.wait_until(lambda: "listening on" in serving.text)
        found = re.search(r"ports (\d+),", serving.text)
        assert found
        with Client(int(found[1])) as made:
            yield made
        serving.process.send_signal(signal.SIGTERM)
        assert serving.wait() == 0, serving.text
        sim.process.send_signal(signal.SIGINT)
        sim.wait()


@pytest.mark.long
def test_microscope_on_topics_is_engaged_scanned_and_withdrawn_by_the_protocol(client: Client) -> None:
    assert client.call("ZCtrl.OnOffGet", returns="I") == [1]
    client.call("Scan.FrameSet", "f f f f f", 0.0, 0.0, 100e-9, 50e-9, 0.0)
    client.call("Scan.BufferSet", "*i i i", [14, 1], 16, 4)
    client.call("Scan.SpeedSet", "f f f f H f", 0.0, 0.0, 0.05, 0.05, 2, 1.0)
    client.call("Scan.Action", "H I", 0, 1)
    # Signals are read while it runs.
    assert abs(client.call("ZCtrl.ZPosGet", returns="f")[0]) < 1e-6
    timed_out, path = client.call("Scan.WaitEndOfScan", "i", -1, returns="I S")
    assert timed_out == 0
    image = read_scan(path)
    assert image.complete and np.isfinite(image.data["height", "retrace"]).all()
    client.call("ZCtrl.Withdraw", "I i", 1, -1)
    assert client.call("ZCtrl.ZPosGet", returns="f")[0] == pytest.approx(5e-6, abs=1e-9)
    # With the tip off the sample too.
    client.call("Scan.BufferSet", "*i i i", [14], 16, 1)
    client.call("Scan.Action", "H I", 0, 1)
    assert client.call("Scan.WaitEndOfScan", "i", -1, returns="I S")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["no_such_scenario"], "no_such_scenario"),
        (["--ports", "x"], "--ports = x is not allowed"),
        (["--ports", "70000"], "--ports = 70000 is not allowed"),
        (["--ports", "TAKEN"], "Address already in use"),
    ],
)
def test_command_that_cannot_start_says_so_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], told: str
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        words = [word.replace("TAKEN", str(taken.getsockname()[1])) for word in arguments]
        assert main([*words, "--out", str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ") and told in line


def test_command_serves_until_it_is_ended_and_withdraws_its_tip(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "afm_model", "nanonis", "--ports", "0", "--stream-port", "0", "--engaged"]
    with Command(*command, "--out", tmp_path / "session", folder=tmp_path) as serving:
        serving.wait_until(lambda: "listening on" in serving.text)
        found = re.search(r"ports (\d+);", serving.text)
        assert found
        with Client(int(found[1])) as client:
            assert client.call("ZCtrl.OnOffGet", returns="I") == [1]
        serving.process.send_signal(signal.SIGTERM)
        assert serving.wait() == 0
        assert "Traceback" not in serving.text
