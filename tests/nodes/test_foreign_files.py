"""A file of somebody else runs nothing: what reads it imports no module that its user has not named."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import recorded
import yaml
from afm_msgs.msg import Score
from recorded import Run, Topic

from afm_bringup import check_command, replay_command
from afm_model import ScenarioError, load_scenario
from afm_model.core import registry
from afm_model.core.schema import flatten
from afm_model.parameters import SimParameters
from afm_node_common.process import InProcess
from afm_recorder_node import inspect_command
from afm_recorder_node.reader import read_recording

CHOICES = [
    *(f"{group}.kind" for group in ("sample", "piezo", "plant", "reference", "detector", "onboard", "fault", "law")),
    "process.parts",
]
EVIL = """
from pathlib import Path
Path({ran!r}).touch()
class X:
    family, name = "anything", "X"
"""


@pytest.fixture(params=["installed", "working folder"])
def ran(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], bool]:
    """Whether the module `evilmod` has been imported, which is on the path or where one works."""
    folder = tmp_path / "place"
    folder.mkdir()
    (folder / "evilmod.py").write_text(EVIL.format(ran=str(tmp_path / "it ran")))
    if request.param == "installed":
        monkeypatch.syspath_prepend(str(folder))
    else:
        monkeypatch.chdir(folder)
    monkeypatch.delitem(sys.modules, "evilmod", raising=False)
    monkeypatch.setattr(registry, "_loaded", {})
    return lambda: (tmp_path / "it ran").exists() or "evilmod" in sys.modules


def recording(path: Path, values: dict[str, object], change: tuple[str, str] | None = None) -> Path:
    def known(node: str, values: dict[str, object]) -> Topic:
        return recorded.parameters(node, {name: value for name, value in values.items() if value != []})

    messages = [known("afm_sim_node", flatten(SimParameters()) | values)]
    messages += [known("afm_controller_node", {"law.kind": "tanh"} | values), *Run(20).block(0, 20)]
    if change is not None:
        messages.append(recorded.parameters("afm_sim_node", dict([change]), changed_at=1e-8))
    messages.append(("score", Score(ticks=20, trajectory_sha256="ab", run_id=1)))
    return recorded.record(path, messages)


@pytest.mark.parametrize("choice", CHOICES)
def test_no_question_to_a_recording_imports_what_it_names(
    choice: str, ran: Callable[[], bool], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(recording(tmp_path / "run.mcap", {choice: "evilmod:X"}))
    for question in ([path], [path, "--table"], [path, "--signal", "deflection"], [path, "--compare", path]):
        assert inspect_command.main(question) == 0, capsys.readouterr().err
    assert choice == "process.parts" or "evilmod:X" in capsys.readouterr().out  # shown as it is
    assert read_recording(path).parameters["afm_sim_node"][choice] == "evilmod:X"
    code = replay_command.main([path])
    told = capsys.readouterr().err
    assert code == 1 and not ran(), told
    if choice != "process.parts":  # this is not of the instrument
        assert f"{choice} = evilmod:X is not allowed" in told and "--parts evilmod:X" in told


def test_no_change_of_a_parameter_in_a_recording_imports_what_it_names(
    ran: Callable[[], bool], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(recording(tmp_path / "run.mcap", {}, ("fault.kind", "evilmod:X")))
    assert inspect_command.main([path]) == 0
    assert replay_command.main([path]) == 1
    assert "--parts evilmod:X" in capsys.readouterr().err and not ran()


@pytest.mark.parametrize("choice", CHOICES)
def test_a_scenario_and_overrides_import_only_what_is_named_on_the_command_line(
    choice: str,
    ran: Callable[[], bool],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    file = tmp_path / "given.yaml"
    file.write_text(yaml.safe_dump({"/**/afm_sim_node": {"ros__parameters": {choice: "evilmod:X"}}}))
    for arguments in ([str(file)], ["closed_loop_tanh", "--overrides", str(file)]):
        monkeypatch.setattr(sys, "argv", ["check_scenario", *arguments])
        assert check_command.main() == 2
        told = capsys.readouterr().err
        assert f"{choice} = evilmod:X" in told and "--parts evilmod:X" in told and not ran()
    with pytest.raises(ScenarioError, match="is named by a file"):
        load_scenario(file, process=InProcess)
    assert not ran()
    # Its user names it: then it runs, and is no such part.
    monkeypatch.setattr(sys, "argv", ["check_scenario", str(file), "--parts", "evilmod:X"])
    assert (check_command.main() == 0) == (choice == "process.parts")
    assert ran() and "named by a file" not in capsys.readouterr().err


def test_a_part_that_the_user_names_but_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"nowhere:X cannot be loaded: ModuleNotFoundError"):
        load_scenario("closed_loop_tanh", parts=["nowhere:X"])
