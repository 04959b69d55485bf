"""Claims about places: folders in which nothing can be built, a home that is not there, a machine that is busy."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support import ROOT, Command, executable

HURRIED = """
import sys
from afm_bringup import session_command, session_start

session_start._SAY_PERIOD, session_start._START_TIMEOUT = 0.2, 1.0
sys.exit(session_command.main())
"""


@pytest.mark.parametrize("name", ["with space", "m\u00e9tier", "(1)"])
def test_make_refuses_a_folder_in_which_ros_cannot_be_built_before_anything_is_made(tmp_path: Path, name: str) -> None:
    folder = tmp_path / name
    for part in ("tools", "requirements"):
        shutil.copytree(ROOT / part, folder / part)
    shutil.copy(ROOT / "Makefile", folder)
    # The tests may run under a make of their own, which would have this one name its folders.
    done = subprocess.run(
        ["make", "--no-print-directory", "demo"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode
    assert done.stderr.startswith(f"error: ROS 2 cannot be built in the folder {folder}\n")
    assert "move the clone" in done.stderr
    assert done.stdout == ""
    assert sorted(path.name for path in folder.iterdir()) == ["Makefile", "requirements", "tools"]


@pytest.fixture
def moved(tmp_path: Path) -> Path:
    """A clone with all that was built, made in another folder."""
    for part in ("tools", "requirements", "Makefile", "env.sh"):
        copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy
        copy(ROOT / part, tmp_path / part)
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    shutil.copy(ROOT / ".venv" / ".complete", tmp_path / ".venv")
    (tmp_path / ".venv" / "pyvenv.cfg").write_text("command = /usr/bin/python3 -m venv /elsewhere/clone/.venv\n")
    (tmp_path / ".venv" / "bin" / "activate").touch()
    install = tmp_path / "ros2_ws" / "install"
    install.mkdir(parents=True)
    for file in ("setup.sh", "local_setup.sh"):
        (install / file).touch()
    return tmp_path


def test_environment_of_a_clone_that_was_moved_is_refused_with_the_command_that_mends_it(moved: Path) -> None:
    done = subprocess.run(["bash", "-c", ". ./env.sh"], cwd=moved, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    said = f"{moved} was built in /elsewhere/clone and then moved or copied; run: make -C {moved} build"
    assert done.stderr == f"error: {said}\n"


def test_make_sets_up_again_what_a_clone_was_moved_with(moved: Path) -> None:
    (moved / "tools" / "bootstrap.sh").write_text("#!/bin/sh\nls .venv\n")  # it sets up what is not there
    command = ["make", "--no-print-directory", "setup"]
    done = subprocess.run(command, cwd=moved, capture_output=True, text=True, check=False)
    assert done.stdout == "This clone was built in /elsewhere/clone and then moved or copied: it is set up again.\n"
    assert "cannot access '.venv'" in done.stderr


def test_middleware_that_the_wheels_do_not_have_is_left_aside_with_a_note() -> None:
    if os.environ.get("AFM_ROS") != "wheels":
        pytest.skip("a ROS 2 of this machine may have any middleware")
    shown = ". ./env.sh && echo ${RMW_IMPLEMENTATION-unset}"
    for name, printed, noted in (
        ("rmw_cyclonedds_cpp", "unset\n", "note: RMW_IMPLEMENTATION = rmw_cyclonedds_cpp is unset here: "),
        ("rmw_fastrtps_cpp", "rmw_fastrtps_cpp\n", ""),
    ):
        environment = os.environ | {"RMW_IMPLEMENTATION": name}
        done = subprocess.run(
            ["bash", "-c", shown], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
        )
        assert done.stdout == printed
        assert done.stderr.startswith(noted) and bool(noted) == bool(done.stderr)


def test_node_without_a_home_says_where_it_logs_and_runs(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    command = ["env", "-u", "ROS_LOG_DIR", "-u", "ROS_HOME", "HOME=/proc/nobody", f"TMPDIR={tmp_path}"]
    command += [executable("afm_recorder_node", "afm_recorder_node"), "--ros-args", "-p"]
    with Command(*command, f"path:={tmp_path}/kept/run.rrd", folder=tmp_path) as node:
        node.wait_until(lambda: list((tmp_path / "kept").iterdir()))
        assert list(tmp_path.glob("ros_log_*"))
        node.process.send_signal(signal.SIGINT)
        assert node.wait() == 0, node.told
        assert node.text.startswith("warning: ROS 2 cannot log into /proc/nobody/.ros/log (No such file or directory);")
        assert "Traceback" not in node.text


def test_start_that_does_not_come_to_its_end_says_what_it_waits_for(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HURRIED, "open_loop", "--no-picture", "--controller", "sh -c 'sleep 1000'"]
    with Command(*command, "--out", tmp_path / "out", folder=tmp_path) as session:
        session.wait_until(lambda: "Still waiting for" in session.text)
        assert session.wait() == 1
        assert session.text.strip().splitlines()[-1].startswith("error: waited "), session.text
