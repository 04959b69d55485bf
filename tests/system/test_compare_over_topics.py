"""A row of a comparison is the same to the last bit over topics: run by a session, or with a node as the law."""

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
import yaml
from clusters import cluster_here
from pd_twin import EXAMPLE
from support import Command, assert_nothing_left, executable, processes, session

from afm_model import compare

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.long
def test_row_over_topics_has_the_trajectory_of_the_table(tmp_path):
    with cluster_here() as scheduler:
        comparison = compare(
            ["observer", "pid"],
            periods=[2e-5],
            delay_ticks=[1],
            noise=[1.0],
            references=["sine 1000"],
            scheduler=scheduler,
            progress=False,
        )
    scenario = tmp_path / "row.yaml"
    sections = comparison.scenario_of(0)
    scenario.write_text(yaml.safe_dump({key: {"ros__parameters": values} for key, values in sections.items()}))
    with session(scenario, tmp_path / "out", folder=tmp_path) as running_session:
        assert running_session.wait() == 0, running_session.text
    card = json.loads((tmp_path / "out" / "scorecard.json").read_text())
    assert card["trajectory_sha256"] == comparison.table["trajectory_sha256"].iloc[0]
    assert processes() == {}


def test_command_leaves_its_files_and_a_node_has_the_rows_of_the_same_law_in_process(tmp_path):
    node = shlex.join([sys.executable, str(EXAMPLE)])
    broken = "sh -c 'echo error: no device; exit 3'"
    command = [executable("afm_bringup", "compare"), "pd_law:PD", "pd_class:Pd", "pd_twin:Twin", "--node", broken]
    command += ["--node", node, "--references", "sine 2500", "--periods", "5e-6", "5e-5", "--delays", "0"]
    done = subprocess.run(
        [*command, "--workers", "1", "--out", str(tmp_path / "out")],
        cwd=ROOT / "examples" / "controllers",
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")])},
        capture_output=True,
        text=True,
        timeout=400,
    )
    assert done.returncode == 0, done.stderr
    table = pd.read_csv(tmp_path / "out" / "comparison.csv", dtype=str)
    rows = {law: runs.drop(columns="law").reset_index(drop=True) for law, runs in table.groupby("law")}
    assert rows["pd_law:PD"]["error"].isna().all() and rows["pd_class:Pd"]["error"].isna().all()
    # As text, all digits. At 5 us it tracks; at 50 us it diverges, in the same sentence.
    assert rows[node]["error"].isna().tolist() == [True, False]
    pd.testing.assert_frame_equal(rows[node], rows["pd_twin:Twin"])
    assert rows[broken]["error"].tolist() == ["the node ended with code 3: no device"] * 2
    page = (tmp_path / "out" / "comparison.html").read_text()
    assert len(page) > 10_000 and "not declared" in page
    assert_nothing_left()


def test_interrupted_command_ends_its_node(tmp_path):
    started = tmp_path / "started"
    waiting = shlex.join([sys.executable, "-c", f"import signal; open({str(started)!r}, 'w'); signal.pause()"])
    command = [executable("afm_bringup", "compare"), "--node", waiting, "--out", tmp_path / "out"]
    with Command(*command, folder=tmp_path) as running:
        running.wait_until(started.exists)
        running.interrupt()
        assert running.wait() == 130, running.text
    assert running.text.endswith("interrupted\n") and "Traceback" not in running.text
    assert_nothing_left()
