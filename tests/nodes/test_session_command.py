"""How a session runs a scenario: as its command line says, and else as the scenario says."""

import sys
from pathlib import Path

import pytest
import yaml

from afm_bringup import scan_command, session_command
from afm_bringup.scenario_input import read_scenario
from afm_bringup.session_nodes import EXTERNAL, commands


@pytest.mark.parametrize(
    ("arguments", "controller"),
    [
        (["realtime_50us"], "composed"),
        (["realtime_50us", "--controller", ""], ""),
        (["realtime_250us"], ""),
        (["realtime_250us", "--composed"], "composed"),
        (["realtime_50us", "--controller", "my_node --fast"], "my_node --fast"),
    ],
)
def test_session_runs_the_controller_where_the_scenario_says(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, arguments: list[str], controller: str
) -> None:
    ran = []

    class Ran:
        def __init__(self, scenario, out, controller, **_):
            ran.append(controller)

        def run(self) -> None:
            pass

    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    monkeypatch.setattr(session_command, "RunSession", Ran)
    monkeypatch.setattr(sys, "argv", ["session", *arguments, "--out", str(tmp_path)])
    assert session_command.main() == 0
    assert ran == [controller]


@pytest.mark.parametrize(
    ("controller", "title"),
    [("", "Closed loop (tanh)"), ("python pd.py", "Closed loop (python pd.py)"), (EXTERNAL, "Closed loop")],
)
def test_title_of_a_recording_names_the_controller_that_runs(controller: str, title: str, tmp_path: Path) -> None:
    scenario = read_scenario("closed_loop_tanh")
    commands(scenario, controller, tmp_path, "/afm", ros_arguments=True, live=False)
    parameters = yaml.safe_load((tmp_path / "parameters.yaml").read_text())
    titles = [
        value
        for section in parameters.values()
        for name, value in section.get("ros__parameters", {}).items()
        if name == "title" and "path" in section["ros__parameters"]
    ]
    assert titles == [title]


def test_scan_takes_a_negative_number_with_an_exponent_for_a_number() -> None:
    asked = scan_command._arguments(["--out", "out", "--centre-x", "-150e-9", "--centre-y", "-.5e-7", "--angle", "-1"])
    assert (asked.centre_x, asked.centre_y, asked.angle) == (-150e-9, -0.5e-7, -1.0)
