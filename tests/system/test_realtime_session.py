"""The scenario in real time that is shipped, for a sixth of its time."""

import json
from pathlib import Path

import pytest
import yaml
from support import ROOT, assert_nothing_left, session


def test_closed_loop_in_real_time_tracks_although_drives_come_late(tmp_path: Path) -> None:
    content = yaml.safe_load((ROOT / "afm_model" / "afm_model" / "scenarios" / "closed_loop_realtime.yaml").read_text())
    simulator = content["/**/afm_sim_node"]["ros__parameters"]
    # A machine that stands still must cost late drives here, not a retracted sample.
    simulator["run"] |= {"duration": 0.02, "watchdog_timeout": 1000.0}
    simulator["score"] = {"start": 0.01}
    scenario = tmp_path / "short.yaml"
    scenario.write_text(yaml.safe_dump(content))
    out = tmp_path / "out"
    with session(scenario, out, folder=tmp_path) as command:
        assert command.wait() == 0, command.text
    card = json.loads((out / "scorecard.json").read_text())
    assert (card["mode"], card["ticks"]) == ("realtime", 4000)
    # The clock may not run fast: 5 us of simulated time take a millisecond. Late, it may.
    assert 0.0 < card["real_time_factor"] < 0.0051
    assert card["realtime"]["ticks_retracted"] == 0
    assert card["contact_fraction"] == 1.0
    # Left alone, the scanner would stick while the reference goes to 4.2 nm.
    for axis in "xy":
        assert card["tracking"][axis]["rms_m"] == pytest.approx(0.0, abs=2e-9)
    assert_nothing_left()
