"""A controller process that is stopped for a while in real time over topics: the run goes on when it answers again."""

import json
import os
import signal
from pathlib import Path

import pytest
import yaml
from afm_msgs.msg import InstrumentStatus
from support import ROOT, Graph, Observer, assert_nothing_left, session

GAP = 200
"""Ticks of a millisecond for which it stands still: longer than the drives that it has sent ahead."""
BETWEEN = 700
"""Ticks between two stops."""


def stopped(tmp_path: Path, times: int) -> dict[str, object]:
    """Scorecard of a run of `realtime_1ms` whose controller was stopped so many times."""
    source = ROOT / "afm_model" / "afm_model" / "scenarios" / "realtime_1ms.yaml"
    content = yaml.safe_load(source.read_text())
    for node in ("afm_sim_node", "afm_controller_node"):
        del content[f"/**/{node}"]["ros__parameters"]["process"]
    content["/**/afm_sim_node"]["ros__parameters"]["run"]["duration"] = 1e-3 * 2 * (times + 1) * (BETWEEN + GAP)
    scenario = tmp_path / "stopped.yaml"
    scenario.write_text(yaml.safe_dump(content))
    with Graph() as graph, session(scenario, tmp_path / "out", folder=tmp_path) as command:
        observer = graph.add(Observer())

        def passed(tick: int) -> bool:
            assert not command.ended, command.told
            return bool(observer.statuses) and observer.status.ticks >= tick

        tick = 0
        for _ in range(times):
            tick += BETWEEN
            graph.spin_until(lambda tick=tick: passed(tick))
            (pid,) = (pid for pid, line in command.descendants.items() if "afm_controller_node" in line)
            os.kill(pid, signal.SIGSTOP)
            tick = observer.status.ticks + GAP
            graph.spin_until(lambda tick=tick: passed(tick))
            os.kill(pid, signal.SIGCONT)
        assert command.wait(graph) in (0, 1), command.text
        assert observer.status.state == InstrumentStatus.FINISHED, command.text
    assert_nothing_left()
    return dict(json.loads((tmp_path / "out" / "scorecard.json").read_text()))


@pytest.mark.parametrize("times", [1, pytest.param(5, marks=pytest.mark.long)])
def test_run_at_1_ms_goes_on_behind_a_controller_that_was_stopped(tmp_path: Path, times: int) -> None:
    card = stopped(tmp_path, times)
    assert card["ticks"] == 2 * (times + 1) * (BETWEEN + GAP)
