"""Claims about places: folders in which nothing can be built, a home that is not there, a machine that is busy."""

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
