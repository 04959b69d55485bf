"""The scenarios of the paper, in full, over topics: the figures that a right implementation shows."""

import json
from pathlib import Path
from typing import Any

import pytest
from support import assert_nothing_left, session

X0 = 2.5e-10
LATERAL, NORMAL = 15e-9, 60e-9
"""Units of the lateral and of the normal force [N]."""


def score(folder: Path, scenario: str, *options: str) -> dict[str, Any]:
    with session(scenario, folder / "out", *options, folder=folder) as command:
        assert command.wait() == 0, command.text
    assert_nothing_left()
    # No picture was asked for: everything else is there.
    names = {"logs", "recording.mcap", "recording.rrd", "scorecard.json"}
    assert {file.name for file in (folder / "out").iterdir()} == names
    return dict(json.loads((folder / "out" / "scorecard.json").read_text()))


@pytest.fixture(scope="module")
def open_loop(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return score(tmp_path_factory.mktemp("open_loop"), "open_loop", "--composed")


@pytest.fixture(scope="module")
def closed_loop(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return score(tmp_path_factory.mktemp("closed_loop"), "closed_loop_tanh", "--composed")


def test_open_loop_sticks_half_of_the_time(open_loop: dict[str, Any]) -> None:
    assert (open_loop["controller"], open_loop["plant"], open_loop["ticks"]) == ("open_loop", "compliant", 50_266)
    assert open_loop["drives_lost"] == 0
    assert open_loop["stick"]["phases"] == 16
    # The figure itself is given to four digits.
    assert open_loop["stick"]["time_fraction"] == pytest.approx(0.5144, abs=0.0005)
    assert open_loop["contact_fraction"] == 1.0


def test_open_loop_reaches_the_positions_and_forces_of_the_reference_solution(open_loop: dict[str, Any]) -> None:
    # Half of the last digit of each figure.
    digit = {"abs": 0.0005, "rel": 0.0}
    assert open_loop["extent_m"]["x"] / X0 == pytest.approx(85.197, **digit)
    assert open_loop["extent_m"]["y"] / X0 == pytest.approx(123.005, **digit)
    assert open_loop["friction_n"]["min"] / LATERAL == pytest.approx(12.513, **digit)
    assert open_loop["friction_n"]["max"] / LATERAL == pytest.approx(13.002, **digit)
    assert open_loop["normal_force_n"]["min"] / NORMAL == pytest.approx(-0.177, **digit)
    assert open_loop["normal_force_n"]["max"] / NORMAL == pytest.approx(0.311, **digit)


def test_closed_loop_tracks_within_one_percent_and_loses_no_drive(closed_loop: dict[str, Any]) -> None:
    assert (closed_loop["controller"], closed_loop["plant"], closed_loop["ticks"]) == ("tanh", "compliant", 62_832)
    assert closed_loop["drives_lost"] == 0
    assert closed_loop["tracking"]["x"]["max_percent"] < 1.0
    assert closed_loop["tracking"]["y"]["max_percent"] < 1.0
    assert closed_loop["contact_fraction"] == 1.0


def test_closed_loop_holds_the_tip_within_a_nanometre(closed_loop: dict[str, Any]) -> None:
    assert closed_loop["tracking"]["z"]["rms_m"] < 1e-9


@pytest.mark.long
def test_closed_loop_of_three_processes_is_that_of_two_nodes_in_one(
    closed_loop: dict[str, Any], tmp_path: Path
) -> None:
    """What `make demo` runs: each node a process of its own."""
    apart = score(tmp_path, "closed_loop_tanh")
    assert apart["drives_lost"] == 0
    assert apart["trajectory_sha256"] == closed_loop["trajectory_sha256"]
    assert (apart["tracking"], apart["stick"]) == (closed_loop["tracking"], closed_loop["stick"])
