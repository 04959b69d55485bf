"""What a command has started ends with it: behind a shell script, in the background, or when the launch is killed."""

import os
import shlex
import signal
import sys
from pathlib import Path

import pytest
from support import Command, executable, processes, wait_for_the_end_of

CHILD = """
import signal, time
signal.signal(signal.SIGHUP, signal.SIG_IGN)
print("child is there", flush=True)
while True:
    time.sleep(0.1)
"""


@pytest.fixture
def script(tmp_path: Path) -> Path:
    """A shell script that starts a program and waits for it; it does not pass signals on."""
    (tmp_path / "child.py").write_text(CHILD)
    script = tmp_path / "start.sh"
    script.write_text(f"#!/bin/sh\n{shlex.join([sys.executable, str(tmp_path / 'child.py')])}\necho over\n")
    script.chmod(0o755)
    return script


def contained(*command: str | Path, folder: Path) -> Command:
    return Command(executable("afm_bringup", "contained"), *command, folder=folder)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_program_behind_a_shell_script_ends_when_the_script_is_asked_to(
    number: signal.Signals, script: Path, tmp_path: Path
) -> None:
    with contained(script, folder=tmp_path) as command:
        command.wait_until(lambda: "child is there" in command.text)
        command.process.send_signal(number)
        assert command.wait() == 0, command.told
    assert processes() == {}


def test_program_behind_a_shell_script_ends_with_the_process_that_has_started_it(script: Path, tmp_path: Path) -> None:
    launch = f"{shlex.join([executable('afm_bringup', 'contained'), str(script)])} & wait"
    with Command("sh", "-c", launch, folder=tmp_path) as command:
        command.wait_until(lambda: "child is there" in command.text)
        left = list(command.descendants)
        os.kill(command.process.pid, signal.SIGKILL)
        command.wait()
        wait_for_the_end_of(left)
    assert processes() == {}


@pytest.mark.long
def test_exit_code_is_that_of_the_command_whose_children_in_the_background_are_ended(
    script: Path, tmp_path: Path
) -> None:
    for code, end in ((3, "exit 3"), (128 + signal.SIGKILL, "kill -9 $$")):
        with contained("sh", "-c", f"{script} & sleep 0.2; {end}", folder=tmp_path) as command:
            assert command.wait() == code, command.told
        assert processes() == {}
    with contained("no_such_program", folder=tmp_path) as command:
        assert command.wait() == 127
        assert command.text == "error: no_such_program could not be started: No such file or directory\n"
