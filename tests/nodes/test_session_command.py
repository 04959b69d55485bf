"""How a session runs a scenario: as its command line says, and else as the scenario says."""

import sys
from pathlib import Path

import pytest

from afm_bringup import session_command


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
