"""Claims about parts of somebody else's over topics: chosen by name in a scenario, the same bytes as in process."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from support import executable, processes, session

from afm_model import load_scenario, simulate
from afm_model.core import registry

PARTS = ("--parts", "patches:PATCHES,creep:CREEP", "--parts", "bursts:BURSTS,kalman:KALMAN")
EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "parts"
SCENARIO = """
/**/afm_sim_node:
  ros__parameters:
    run: {duration: 4.0e-3}
    score: {start: 0.0}
    sample: {kind: "patches:PATCHES", ratio: 0.3}
    piezo: {kind: "creep:CREEP"}
    fault: {kind: "bursts:BURSTS", loss: 0.05}
    detector: {position_noise: 5.0e-11, channels: "truth/creep_x"}
/**/afm_controller_node:
  ros__parameters:
    law: {kind: "kalman:KALMAN", bandwidth: 2.0e4}
"""


@pytest.fixture
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder outside the tree with the parts, found by this process and by those that it starts."""
    folder = tmp_path / "outside"
    shutil.copytree(EXAMPLES, folder, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH")])))
    return folder


def test_nodes_run_parts_from_outside_with_the_bytes_of_the_simulation(outside, tmp_path):
    scenario = tmp_path / "own.yaml"
    scenario.write_text(SCENARIO)
    loaded = load_scenario(scenario, parts=registry.listed(",".join(PARTS[1::2])))
    expected = simulate(loaded.sim, loaded.controller)
    with session(scenario, tmp_path / "out", *PARTS, folder=tmp_path) as running:
        assert running.wait() == 0, running.told
    card = json.loads((tmp_path / "out" / "scorecard.json").read_text())
    # A law with a state, a sample, a piezo and a fault by seed: nothing of it depends on where the law runs.
    assert card["trajectory_sha256"] == expected.trajectory_sha256
    assert processes() == {}


def test_help_tells_the_parameters_of_a_part_from_outside(outside):
    command = [executable("afm_controller_node", "afm_controller_node"), "--help"]
    told = subprocess.run(
        [*command, "--ros-args", "-p", "law.kind:=kalman:KALMAN"], capture_output=True, text=True, check=True
    )
    assert "law.bandwidth := 10000.0 rad/s" in told.stdout
    assert "law.alpha" not in told.stdout
    assert "law.alpha := 10.0" in subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_a_broken_part_ends_its_node_with_a_sentence_that_names_it(outside, tmp_path):
    (outside / "broken.py").write_text("from afm_model.parts import Law\nLAW = Law()\n")
    command = [executable("afm_controller_node", "afm_controller_node"), "--ros-args", "-p", "law.kind:=broken:LAW"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith(
        "error: law.kind = broken:LAW is not allowed: law broken:LAW cannot be loaded: TypeError"
    )
    assert "Traceback" not in done.stderr


@pytest.mark.long
def test_a_law_that_fails_while_it_runs_ends_its_node_with_a_sentence(outside, tmp_path):
    (outside / "failing.py").write_text(
        "import dataclasses, kalman\n"
        "def control(t, y, u, p, s):\n"
        "    if y.reference_position[0] != 0.0:\n"
        "        raise LookupError('no such gain')\n"
        "    kalman.control.py_func(t, y, u, p, s)\n"
        "LAW = dataclasses.replace(kalman.KALMAN, control=control)\n"
    )
    scenario = tmp_path / "failing.yaml"
    scenario.write_text(SCENARIO.replace("kalman:KALMAN", "failing:LAW"))
    with session(scenario, tmp_path / "out", *PARTS, "--parts", "failing:LAW", folder=tmp_path) as running:
        assert running.wait() == 1
        assert "law failing:LAW: control: LookupError: no such gain" in running.text
        assert "Traceback" not in running.text
    assert processes() == {}
