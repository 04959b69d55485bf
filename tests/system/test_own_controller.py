"""A controller of one's own, an ordinary rclpy node, is started, scored and told off by a session."""

import json
import math
import shlex
import sys
from pathlib import Path

import pytest
from afm_msgs.msg import Measurement, PiezoDrive
from support import ROOT, Graph, HandController, answer, assert_nothing_left, session, write_scenario

TICKS = 1000
SIMULATOR = {"run.duration": TICKS * 20e-6, "plant.control_period": 20e-6, "score.start": 0.0}
EXAMPLE = ROOT / "examples" / "pd_controller.py"


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    return write_scenario(tmp_path / "short.yaml", afm_sim_node=SIMULATOR)


def test_example_of_the_readme_is_the_one_that_is_tested() -> None:
    assert f"```python\n{EXAMPLE.read_text()}```" in (ROOT / "README.md").read_text()


def test_ordinary_node_is_scored_and_ended_even_behind_another_process(scenario: Path, tmp_path: Path) -> None:
    """As `ros2 run` of ros2cli starts it: a child of the command, which waits for it and passes no signal on."""
    wrapper = tmp_path / "wrapper.py"
    wrapper.write_text(
        "import subprocess, sys\n"
        "child = subprocess.Popen(sys.argv[1:])\n"
        "while child.returncode is None:\n"
        "    try:\n"
        "        child.wait()\n"
        "    except KeyboardInterrupt:\n"
        "        pass  # the child has received it too and ends\n"
    )
    out = tmp_path / "out"
    wrapped = shlex.join([sys.executable, str(wrapper), sys.executable, str(EXAMPLE)])
    with session(scenario, out, "--controller", wrapped, folder=tmp_path) as command:
        assert command.wait() == 0, command.text
    card = json.loads((out / "scorecard.json").read_text())
    assert (card["controller"], card["ticks"], card["drives_lost"]) == ("/afm/pd_controller", TICKS, 0)
    # No more than that it tracks at all: without a drive the error is the reference itself, which goes up to 4.2 nm.
    assert 0.0 < card["tracking"]["x"]["max_m"] < 1e-9
    assert 0.0 < card["tracking"]["y"]["max_m"] < 1e-9
    assert_nothing_left()


def test_controller_started_elsewhere_that_answers_nan_is_told_and_leaves_no_results(
    scenario: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"

    def broken(measurement: Measurement) -> list[PiezoDrive]:
        return [answer(measurement, 0.1, 0.0 if measurement.sequence < 100 else math.nan)]

    with Graph() as graph, session(scenario, out, "--controller", "external", folder=tmp_path) as command:
        controller = graph.add(HandController(broken, "somebody"))
        assert command.wait(graph) == 1, command.text
        assert controller.seen[-1].sequence == 100
    assert command.text.strip().splitlines()[-1] == (
        "error: drive y = nan V is not allowed: every voltage must be a finite number "
        "(answer to measurement 100 from /afm/somebody)"
    )
    assert "Traceback" not in command.text
    assert {file.name for file in out.iterdir()} == {"logs"}
    assert_nothing_left()


def test_controller_of_which_no_drive_was_ever_applied_has_no_score(tmp_path: Path) -> None:
    out = tmp_path / "out"
    parameters = SIMULATOR | {"run.mode": "realtime", "run.real_time_factor": 0.02, "run.duration": 0.01}
    scenario = write_scenario(tmp_path / "realtime.yaml", afm_sim_node=parameters)
    with Graph() as graph, session(scenario, out, "--controller", "external", folder=tmp_path) as command:
        graph.add(HandController(lambda measurement: [answer(measurement, math.inf, 0.0)], "somebody"))
        assert command.wait(graph) == 1, command.text
    last = command.text.strip().splitlines()[-1]
    assert last.startswith("error: no drive of /afm/somebody was ever applied in 500 ticks; ")
    assert last.endswith(" were refused as NaN or infinite")
    assert {file.name for file in out.iterdir()} == {"logs"}
    assert_nothing_left()
