"""The tutorials say what works: their commands are taken, their files are read, their programs run."""

import re
import shlex
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from recorded import Run

from afm_bringup import compare_command, session_command
from afm_bringup.scenario_input import read_scenario
from afm_recorder_node import inspect_command
from afm_recorder_node.writer import RecordingWriter

ROOT = Path(__file__).resolve().parents[2]
FIRST, RANK, FIGURE = ((ROOT / "docs" / f"{name}.md").read_text() for name in ("first_run", "rank", "figure"))


def commands(page: str, program: str) -> list[list[str]]:
    """Arguments of a program in the commands of a page."""
    lines = re.findall(rf"^    ros2 run \w+ {program} (.*)$", page, re.MULTILINE)
    assert lines
    return [shlex.split(line, comments=True) for line in lines]


def recording(path: Path, friction: float = 1e-7) -> None:
    """A tip that slides to and fro for two periods of 12 ms."""
    run = Run(12_000)
    run.position[:, 0] = 5e-9 * np.sin(2.0 * np.pi * np.arange(12_000) / 6_000)
    run.samples[1] = friction / run.scales[1] * np.sign(np.cos(2.0 * np.pi * np.arange(24_000) / 12_000))
    path.parent.mkdir(parents=True)
    writer = RecordingWriter(path)
    run.write(writer, 0, run.ticks)
    writer.close()


def test_program_and_commands_of_the_figure_draw_what_they_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    recording(tmp_path / "out" / "demo" / "recording.rrd")
    (program,) = re.findall(r"<!-- figure -->\n```python\n(.*?)```\n<!-- end -->", FIGURE, re.DOTALL)
    exec(compile(program, "figure", "exec"), {})
    assert capsys.readouterr().out == "(501, 3) V\n"
    for arguments in commands(FIGURE, "inspect"):
        assert inspect_command.main(arguments) == 0
    assert "friction, half the width: 100 nN" in capsys.readouterr().out
    assert {each.name for each in tmp_path.iterdir()} == {"out", "figure.pdf", "loop.pdf", "error.png", "error.csv"}
    assert (tmp_path / "figure.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(("page", "name", "value"), [(FIRST, "alpha", 5.0), (RANK, "kind", "mine:PD")])
def test_sessions_of_the_tutorials_are_taken_with_the_files_of_the_page(
    page: str, name: str, value: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    shutil.copy(ROOT / "examples" / "controllers" / "pd_law.py", tmp_path / "mine.py")
    (text,) = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    Path("mine.yaml").write_text(text)
    (arguments,) = commands(page, "session")
    monkeypatch.setattr(sys, "argv", ["session", *arguments])
    asked = session_command._arguments()
    scenario = read_scenario(asked.scenario, asked.overrides, asked.parts)
    assert getattr(scenario.controller.law, name) == value
    assert 0.12 < scenario.sim.run.duration < 0.13


def test_law_of_the_tutorial_gets_its_rank(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    shutil.copy(ROOT / "examples" / "controllers" / "pd_law.py", tmp_path / "mine.py")
    (arguments,) = commands(RANK, "compare")
    monkeypatch.setattr(sys, "argv", ["compare", *arguments, "--workers", "1", "--cycles", "0.7"])
    assert compare_command.main() == 0
    said = capsys.readouterr().out
    ranked = re.findall(r"^ *(observer|pid|mine:PD slowness=2|mine:PD)  ", said, re.MULTILINE)
    assert ranked == ["observer", "pid", "mine:PD slowness=2", "mine:PD"]
    assert (tmp_path / "out" / "rank" / "comparison.html").is_file()
