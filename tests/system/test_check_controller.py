"""`check_controller` starts a controller and says rule by rule whether it keeps the contract."""

import sys
from pathlib import Path

import pytest
from support import ROOT, Command, assert_nothing_left, executable, write_scenario
from wrong_controllers import WAYS

OURS = executable("afm_controller_node", "afm_controller_node")
WRONG = Path(__file__).resolve().parents[1] / "wrong_controllers.py"
RIGHT = {
    "ours": (OURS,),
    "pd_controller": (sys.executable, ROOT / "examples" / "pd_controller.py"),
    "a law of one's own": (OURS,),
}
PRINTED = "printed.log"
OVER_TOPICS = [way for way in WAYS if way not in ("right", "too far", "too steep", "leaks", "a microvolt more")]
"""Those that the default scenario can find out: it has no limits."""


def check(*command: str | Path, folder: Path, measurements: int = 1000, scenario: Path | None = None) -> Command:
    options = ("--measurements", str(measurements), "--log", folder / PRINTED)
    chosen = ("--scenario", scenario, "--parts", "pd_law:PD") if scenario is not None else ()
    return Command(executable("afm_bringup", "check_controller"), *options, *chosen, "--", *command, folder=folder)


def outcomes(text: str) -> dict[str, str]:
    """What became of each rule, by the table that was printed."""
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in text.splitlines() if line.startswith("│")]
    return {row[0]: row[1] for row in rows if row[0]}


def test_our_controller_keeps_every_rule_that_can_be_tested(tmp_path: Path) -> None:
    with check(OURS, folder=tmp_path) as command:
        assert command.wait(timeout=280.0) == 0, command.text
    found = outcomes(command.text)
    assert {rule for rule, outcome in found.items() if outcome == "not tested"} == {"slew"}
    assert set(found.values()) == {"kept", "not tested"}
    assert_nothing_left()


@pytest.mark.parametrize(
    ("way", "sentence"),
    [
        ("nan", "the drive for measurement 50 is [nan,"),
        ("gains a thousandth", "x does not follow its reference in the first 2000 measurements"),
        pytest.param(
            "damps the wrong way",
            "x does not follow its reference in the first 2000 measurements",
            marks=pytest.mark.long,
        ),
        pytest.param("leaks", "it has taken ", marks=pytest.mark.long),
    ],
)
def test_a_wrong_controller_is_found_out(tmp_path: Path, way: str, sentence: str) -> None:
    with check(sys.executable, WRONG, way, folder=tmp_path) as command:
        assert command.wait(timeout=280.0) == 1, command.text
    found = outcomes(command.text)
    assert [rule for rule, outcome in found.items() if outcome == "broken"] == [WAYS[way]]
    assert sentence in " ".join(command.text.split())
    assert_nothing_left()


@pytest.mark.parametrize(
    ("command", "sentence", "printed"),
    [
        pytest.param(
            ["/nowhere/controller"],
            "error: the controller could not be started: /nowhere/controller: No such file",
            "",
            marks=pytest.mark.long,
        ),
        (
            ["sh", "-c", "echo error: no device; exit 3"],
            "the controller ended with code 3: no device",
            "error: no device\n",
        ),
        # A line that says nothing of an error is not given as the reason.
        (["sh", "-c", "echo 1"], 'the controller ended with code 0; last line it printed: "1"', "1\n"),
    ],
)
def test_what_cannot_be_tested_is_told_from_what_is_wrong(
    tmp_path: Path, command: list[str], sentence: str, printed: str
) -> None:
    with check(*command, folder=tmp_path) as run:
        assert run.wait() == 2, run.text
    assert sentence in run.text
    assert (tmp_path / PRINTED).read_text() == printed
    # What could not be looked at is not said to be kept.
    assert "kept" not in outcomes(run.text).values()
    assert_nothing_left()


@pytest.mark.long
@pytest.mark.parametrize("way", OVER_TOPICS)
def test_a_controller_that_is_wrong_in_one_way_is_found_out_over_topics(tmp_path: Path, way: str) -> None:
    with check(sys.executable, WRONG, way, folder=tmp_path) as command:
        assert command.wait(timeout=280.0) == 1, command.text
    assert outcomes(command.text)[WAYS[way]] == "broken", command.text
    assert_nothing_left()


@pytest.mark.long
@pytest.mark.timeout(1000)
def test_our_controller_keeps_every_rule_of_the_whole_examination(tmp_path: Path) -> None:
    with check(OURS, folder=tmp_path, measurements=100_000) as command:
        assert command.wait(timeout=900.0) == 0, command.text
    assert outcomes(command.text)["memory"] == "kept"


@pytest.mark.long
@pytest.mark.parametrize("controller", list(RIGHT)[1:])
def test_examples_keep_every_rule(tmp_path: Path, controller: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "examples" / "controllers"), prepend=":")
    scenario = None
    if controller == "a law of one's own":
        # It leaves z to the instrument. At 50 us its gains are too small to move x and y: `follows` says so.
        scenario = write_scenario(
            tmp_path / "own.yaml",
            afm_sim_node={"plant.kind": "compliant", "plant.control_period": 1e-5, "onboard.kind": "pi"},
            afm_controller_node={"law.kind": "pd_law:PD"},
        )
    with check(*RIGHT[controller], folder=tmp_path, scenario=scenario) as command:
        assert command.wait(timeout=280.0) == 0, command.text
    assert ("law: pd_law:PD" in (tmp_path / PRINTED).read_text()) == (scenario is not None)
    assert_nothing_left()
