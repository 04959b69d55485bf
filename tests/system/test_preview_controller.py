"""The example that looks ahead: over topics it does what it does in process, and a corner costs it next to nothing."""

import json
import shlex
import sys
from pathlib import Path

import pytest
from support import ROOT, assert_nothing_left, session, write_scenario

from afm_bringup.node_law import node_contender
from afm_model import SimParameters, build, simulate
from afm_model.studies import contender
from afm_model.studies.wrong_models import CASE, Rate, run_case

PERIOD = 5e-5
EXAMPLE = ROOT / "examples" / "preview_controller.py"
NODE = shlex.join([sys.executable, str(EXAMPLE)])
TRIANGLE = {f"reference.shape_{axis}": "triangle" for axis in "xy"}
TRIANGLE |= {"plant.control_period": PERIOD, "plant.delay_ticks": 1}


@pytest.fixture
def laws(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(EXAMPLE.parent / "controllers"))
    import preview_class

    return preview_class


@pytest.mark.long
def test_session_with_it_is_the_run_in_process_beyond_the_first_page_of_the_preview(tmp_path: Path, laws) -> None:
    simulator = TRIANGLE | {"run.duration": 4500 * PERIOD, "score.start": 0.0}
    scenario = write_scenario(
        tmp_path / "triangle.yaml", afm_sim_node=simulator, preview_controller={"law.delay_ticks": 1}
    )
    with session(scenario, tmp_path / "out", "--controller", NODE, folder=tmp_path) as command:
        assert command.wait() == 0, command.text
    card = json.loads((tmp_path / "out" / "scorecard.json").read_text())
    sim = build(SimParameters, simulator)
    assert card["trajectory_sha256"] == simulate(sim, laws.Ahead(sim)).trajectory_sha256
    assert_nothing_left()


def test_comparison_offers_it_the_same_preview(laws) -> None:
    sim = build(SimParameters, TRIANGLE | {"run.duration": 200 * PERIOD, "score.start": 0.0})
    start = node_contender(NODE).start
    assert start is not None
    with start(sim) as law:
        assert simulate(sim, law).trajectory_sha256 == simulate(sim, laws.Ahead(sim)).trajectory_sha256
    assert_nothing_left()


def test_node_in_the_table_of_wrong_models_has_the_row_of_the_same_law_in_process(laws) -> None:
    rate = Rate("1 ms", 1e-3, 1)
    over_topics, in_process = (
        run_case(CASE["resonances +2 %"], rate, law) for law in (node_contender(NODE), contender("preview_class:Ahead"))
    )
    assert over_topics == in_process and over_topics["third"] > 0.0
    assert_nothing_left()


def test_looking_ahead_takes_a_corner_that_is_a_period_late_otherwise(laws) -> None:
    cycle = 0.12566370614359174
    sim = build(SimParameters, TRIANGLE | {"run.duration": 1.5 * cycle, "score.start": 0.5 * cycle})
    ahead, blind = (max(simulate(sim, law(sim)).score.max_percent[:2]) for law in (laws.Ahead, laws.Blind))
    assert ahead < 0.5 * blind
