"""`ros2 launch` takes a run from its scenario to its score; without launch, what the file needs of ours is tested."""

import ast
import importlib.util
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from afm_msgs.msg import InstrumentStatus
from support import ROOT, Command, Graph, Observer, assert_nothing_left, note_shared_memory, processes, write_scenario

from afm_model import ControllerParameters, SimParameters, build, simulate
from afm_recorder_node.reader import read_recording

LAUNCH_FILE = ROOT / "afm_bringup" / "launch" / "instrument.launch.py"
SIMULATOR = {"run.duration": 0.004, "plant.control_period": 2e-6}

needs_launch = pytest.mark.skipif(
    importlib.util.find_spec("launch_ros") is None, reason="launch_ros is not installed: it comes with a full ROS 2"
)

SEVERAL = """
import json, sys
from launch import LaunchDescription, LaunchService
from launch.actions import GroupAction, IncludeLaunchDescription
from launch_ros.actions import PushRosNamespace

def instrument(namespace, arguments):
    include = IncludeLaunchDescription(sys.argv[1], launch_arguments=arguments.items())
    return GroupAction([*([PushRosNamespace(namespace)] if namespace else []), include])

service = LaunchService()
service.include_launch_description(LaunchDescription([instrument(*each) for each in json.loads(sys.argv[2])]))
sys.exit(service.run())
"""
"""What `ros2 launch` does, or a launch file that includes ours."""


class Launch(Command):
    """A launch of one instrument with `arguments`, or of several: namespace, arguments."""

    def __init__(self, folder: Path, *several: tuple[str, dict[str, str]], **arguments: str) -> None:
        program = folder / "several.py"
        program.write_text(SEVERAL)
        wanted = json.dumps(several or [("", arguments)])
        # Nodes write where the launch runs.
        place = ("env", "-C", folder, f"ROS_LOG_DIR={folder}/log")
        super().__init__(*place, sys.executable, program, LAUNCH_FILE, wanted, folder=folder)


@pytest.fixture
def scenario(tmp_path: Path) -> str:
    return str(write_scenario(tmp_path / "short.yaml", afm_sim_node=SIMULATOR))


@pytest.fixture
def endless(tmp_path: Path) -> str:
    return str(
        write_scenario(tmp_path / "endless.yaml", afm_sim_node={"run.duration": 1e4, "plant.control_period": 2e-6})
    )


@pytest.fixture(scope="module")
def trajectory() -> str:
    return simulate(build(SimParameters, SIMULATOR), ControllerParameters()).trajectory_sha256


def sha256(card: Path) -> str:
    return str(json.loads(card.read_text())["trajectory_sha256"])


def test_launch_file_imports_nothing_beyond_ros() -> None:
    imported = [
        f"from {node.module} import {', '.join(alias.name for alias in node.names)}"
        for node in ast.parse(LAUNCH_FILE.read_text()).body
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("afm_")
    ]
    assert imported
    # None in sys.modules: as if it were not installed.
    absent = (
        "import sys; sys.modules |= dict.fromkeys(('numpy', 'numba', 'scipy', 'pydantic', 'rerun', 'rich', 'yaml'))"
    )
    program = "\n".join([absent, *imported, "print(executable('afm_bringup', 'session').rpartition('/')[2])"])
    end = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (end.returncode, end.stdout) == (0, "session\n"), end.stderr


@needs_launch
def test_launch_ends_when_the_run_is_finished_with_the_recording_closed_and_the_score_written(
    scenario: str, trajectory: str, tmp_path: Path
) -> None:
    with Launch(tmp_path, scenario=scenario) as launch:
        assert launch.wait() == 0, launch.text
    assert sha256(tmp_path / "scorecard.json") == trajectory
    assert len(read_recording(tmp_path / "recording.rrd").time_ticks) == 2000
    assert trajectory[:16] in launch.text
    assert_nothing_left()


@needs_launch
def test_live_page_of_a_launch_prints_its_link_and_ends_with_it(endless: str, tmp_path: Path) -> None:
    with Launch(tmp_path, scenario=endless, viewer="web") as launch:
        launch.wait_until(lambda: "/proxy" in launch.text)
        launch.interrupt()
        launch.wait()
    assert_nothing_left()


@needs_launch
def test_two_instruments_in_one_launch_share_nothing_and_the_first_to_end_leaves_the_other_alone(
    scenario: str, tmp_path: Path
) -> None:
    longer = str(write_scenario(tmp_path / "longer.yaml", afm_sim_node={"run.duration": 0.02}))
    overrides = write_scenario(tmp_path / "over.yaml", afm_sim_node={"plant.control_period": 2e-6})
    with Launch(
        tmp_path,
        ("lab1", {"scenario": longer, "overrides": str(overrides), "controller": "composed", "scorecard": "one.json"}),
        ("", {"scenario": scenario, "namespace": "lab2", "controller": "composed", "recording": "off"}),
    ) as launch:
        launch.wait_until(lambda: "the run on /lab2 is finished" in launch.text)
        assert launch.wait() == 0, launch.text
    expected = [
        simulate(build(SimParameters, SIMULATOR | {"run.duration": duration}), ControllerParameters()).trajectory_sha256
        for duration in (0.02, 0.004)
    ]
    assert [sha256(tmp_path / "one.json"), sha256(tmp_path / "scorecard-lab2.json")] == expected
    (recording,) = tmp_path.glob("*.rrd")
    assert recording.name == "recording-lab1.rrd"
    assert len(read_recording(recording).time_ticks) == 10_000
    assert_nothing_left()


@needs_launch
def test_node_that_dies_ends_the_launch_with_code_1_and_its_name(endless: str, tmp_path: Path) -> None:
    with Graph() as graph, Launch(tmp_path, scenario=endless, recording="false", scorecard="off") as launch:
        observer = graph.add(Observer())
        launch.wait_until(lambda: observer.status.state == InstrumentStatus.RUNNING, graph)
        note_shared_memory()
        (victim,) = (pid for pid, line in launch.descendants.items() if "/afm_controller_node " in line)
        os.kill(victim, signal.SIGTERM)
        assert launch.wait(graph) == 1, launch.text
    assert "afm_controller_node on /afm ended with code 0: all are ended" in launch.text
    assert not list(tmp_path.glob("recording*"))
    assert not list(tmp_path.glob("scorecard*"))
    assert processes() == {}


REFUSED = {
    "scenario": ({"scenario": "nonesuch"}, "unknown scenario nonesuch: it must be one of closed_loop_predictive"),
    "controller": ({"controller": "no_such_program --fast"}, "controller:=no_such_program --fast is not allowed"),
    "mode": ({"mode": "hasty"}, "mode"),
}


@needs_launch
@pytest.mark.parametrize("name", REFUSED)
def test_argument_that_is_not_allowed_is_refused_before_anything_runs(name: str, tmp_path: Path) -> None:
    arguments, sentence = REFUSED[name]
    with Launch(tmp_path, **arguments) as launch:
        assert launch.wait() == 1, launch.text
    assert sentence in launch.text
    assert "process started" not in launch.text


@needs_launch
def test_command_for_the_controller_is_given_the_scenario_and_the_namespace(scenario: str, tmp_path: Path) -> None:
    example = f"{sys.executable} {ROOT / 'examples' / 'pd_controller.py'}"
    with Launch(tmp_path, scenario=scenario, controller=example, namespace="lab3", recording="0") as launch:
        assert launch.wait() == 0, launch.text
    card = json.loads((tmp_path / "scorecard-lab3.json").read_text())
    assert (card["controller"], card["ticks"]) == ("/lab3/pd_controller", 2000)
    assert_nothing_left()


@needs_launch
def test_controller_behind_a_shell_script_does_not_outlive_the_launch(scenario: str, tmp_path: Path) -> None:
    script = tmp_path / "start.sh"
    script.write_text(f'#!/bin/sh\n{sys.executable} {ROOT / "examples" / "pd_controller.py"} "$@"\necho over\n')
    script.chmod(0o755)
    with Launch(tmp_path, scenario=scenario, controller=str(script), recording="0") as launch:
        assert launch.wait() == 0, launch.text
        assert processes() == {}
