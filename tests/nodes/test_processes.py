"""Ending processes: one that completes its work is waited for, one that does nothing is not; others are left alone."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import support

from afm_bringup import processes
from afm_bringup.processes import NodeProcess

PROGRAM = """
import signal, sys, time
asked = []
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, lambda *_: asked.append(1))
print("ready", flush=True)
while not asked:
    time.sleep(0.01)
end = time.process_time() + 1.0
while time.process_time() < end:
    {does}
print("done", flush=True)
"""


def end(does: str, at_work: float, folder: Path) -> tuple[int | None, str]:
    """Exit code and output of a program that wants a second of processor time after SIGINT."""
    log = folder / "log"
    process = NodeProcess("program", [sys.executable, "-c", PROGRAM.format(does=does)], log, "mark")
    while "ready" not in log.read_text():
        assert not process.ended
    process.end(at_work)
    return process._process.returncode, log.read_text()


def test_process_that_works_after_sigint_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "_PATIENCE", 0.3)
    assert end("pass", 60.0, tmp_path) == (0, "ready\ndone\n")


@pytest.mark.parametrize(("does", "at_work"), [("time.sleep(60)", 60.0), ("pass", 0.0)])
def test_process_that_does_nothing_or_may_not_work_on_is_killed(
    does: str, at_work: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes, "_PATIENCE", 0.1)
    assert end(does, at_work, tmp_path) == (-signal.SIGKILL, "ready\n")


def test_what_a_test_run_ends_is_its_own_and_nothing_of_another_run() -> None:
    command = [sys.executable, "-c", "import signal; print('ready', flush=True); signal.pause()"]
    marks = {"ours": os.environ[support.MARK], "another run's": "0" * 32, "nobody's": ""}
    started = {
        whose: subprocess.Popen(command, env=os.environ | {support.MARK: mark}, stdout=subprocess.PIPE)
        for whose, mark in marks.items()
    }
    try:
        assert all(process.stdout and process.stdout.readline() for process in started.values())
        assert set(support.processes()) == {started["ours"].pid}
        support.kill(started["another run's"].pid)
        assert set(support.end_all_processes()) == {started["ours"].pid}
        assert started["ours"].wait() == -signal.SIGKILL
        assert [started[whose].poll() for whose in ("another run's", "nobody's")] == [None, None]
    finally:
        for process in started.values():
            process.kill()
            process.communicate()
