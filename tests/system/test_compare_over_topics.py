"""A row of a comparison, run over topics by a session, is the same to the last bit; and the command as it is typed."""

import json
import subprocess
from pathlib import Path

import distributed
import pandas as pd
import yaml
from support import executable, processes, session

from afm_model import compare

ROOT = Path(__file__).resolve().parents[2]


def test_row_over_topics_has_the_trajectory_of_the_table(tmp_path):
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address="127.0.0.1:0"
    ) as running:
        comparison = compare(
            ["observer", "pid"],
            periods=[2e-5],
            delay_ticks=[1],
            noise=[1.0],
            references=["sine 1000"],
            scheduler=running.scheduler_address,
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


def test_command_of_the_docs_leaves_its_three_files(tmp_path):
    command = [executable("afm_bringup", "compare"), "pd_law:PD", "pd_class:Pd", "--references", "sine 2500"]
    done = subprocess.run(
        [*command, "--periods", "5e-5", "--delays", "0", "--workers", "1", "--out", str(tmp_path / "out")],
        cwd=ROOT / "examples" / "controllers",
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    table = pd.read_csv(tmp_path / "out" / "comparison.csv")
    assert table["error"].isna().all() and list(table["law"]) == ["pd_law:PD", "pd_class:Pd"]
    assert (tmp_path / "out" / "comparison.html").stat().st_size > 10_000
