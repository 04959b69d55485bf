"""Claims about sweeps: each row is the single run, whatever runs it; one bad set costs none of the others."""

import gc
import multiprocessing
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing import resource_tracker
from pathlib import Path

import distributed
import numpy as np
import pandas as pd
import pytest
from clusters import cluster_here

from afm_model import ParameterError, Scenario, SweepError, simulate, sweep
from afm_model.compiled import cache as kernel_cache
from afm_model.law import TimingWarning
from afm_model.parameters import ControllerParameters, SimParameters, build, changed

ROOT = Path(__file__).resolve().parents[2]
SIM = {
    "plant.control_period": 4e-6,
    "detector.sample_period": 2e-6,
    "detector.noise": 1e-3,
    "detector.position_noise": 1e-12,
    "run.duration": 2e-3,
    "score.start": 1e-3,
}
ALPHA = "afm_controller_node.law.alpha"
DELAY = "afm_sim_node.plant.delay_ticks"
SEED = "afm_sim_node.plant.seed"


def scenario(**values: object) -> Scenario:
    """A short noisy run."""
    return Scenario("short", Path("short.yaml"), sim=build(SimParameters, SIM | values))


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """Address of a running scheduler with two workers, in this process."""
    with cluster_here(workers=2) as address:
        yield address


def test_row_is_the_single_run_to_the_last_bit(cluster):
    table = sweep(scenario(), {ALPHA: [5.0, 20.0], DELAY: [0, 3]}, scheduler=cluster, fingerprint=True, progress=False)
    assert list(zip(table[ALPHA], table[DELAY], strict=True)) == [(5.0, 0), (5.0, 3), (20.0, 0), (20.0, 3)]
    assert table["error"].isna().all()
    for _, row in table.iterrows():
        sim = build(SimParameters, SIM | {"plant.delay_ticks": row[DELAY]})
        single = simulate(sim, build(ControllerParameters, {"law.alpha": row[ALPHA]}))
        score = single.score
        assert row["trajectory_sha256"] == single.trajectory_sha256
        assert (row["ticks"], row["stick_phases"]) == (score.ticks, score.stick_phases)
        for name in ("rms", "max", "max_percent", "drive_total_variation", "extent"):
            np.testing.assert_array_equal([row[f"{name}_{axis}"] for axis in "xyz"], getattr(score, name))
        assert (row["friction_low"], row["friction_high"]) == score.friction
        assert (row["normal_force_low"], row["normal_force_high"]) == score.normal_force
        assert (row["stick_fraction"], row["contact_fraction"]) == (score.stick_fraction, score.contact_fraction)


def test_table_in_lanes_is_that_of_runs_one_by_one(cluster):
    sets = {SEED: list(range(8)), "afm_sim_node.piezo.limit": [0.0, 1e-3]}
    tables = [
        sweep(scenario(), sets, scheduler=cluster, fingerprint=True, lanes=lanes, progress=False)
        for lanes in (True, False)
    ]
    assert tables[0]["error"].notna().sum() == 8
    pd.testing.assert_frame_equal(*tables)


def test_rows_of_a_table_keep_order_and_index(cluster):
    rows = pd.DataFrame({SEED: [7, 3, 7], ALPHA: [10.0, 20.0, 10.0]}, index=["a", "b", "c"])
    table = sweep(scenario(), rows, scheduler=cluster, fingerprint=True, progress=False)
    pd.testing.assert_frame_equal(table[[SEED, ALPHA]], rows)
    hashes = table["trajectory_sha256"]
    assert hashes["a"] == hashes["c"] != hashes["b"]
    same = sweep(scenario(), rows.to_dict("list"), grid=False, scheduler=cluster, fingerprint=True, progress=False)
    pd.testing.assert_frame_equal(same, table.reset_index(drop=True))


def test_bad_sets_cost_none_of_the_others_and_change_no_type(cluster):
    values = {ALPHA: [10.0, -1.0], DELAY: [0, 200]}
    base = scenario(**{"run.duration": 0.02})
    table = sweep(base, values, scheduler=cluster, fingerprint=True, progress=False)
    good = sweep(base, {ALPHA: [10.0], DELAY: [0]}, scheduler=cluster, fingerprint=True, progress=False)
    assert (table.dtypes == good.dtypes).all()
    assert table["trajectory_sha256"][0] == good["trajectory_sha256"][0]
    with pytest.raises(Exception, match="diverged") as single:
        simulate(build(SimParameters, SIM | {"plant.delay_ticks": 200, "run.duration": 0.02}), ControllerParameters())
    assert re.match(r"the motion diverged \(beyond 0.001 m\) at \S+ s under a drive of", str(single.value))
    assert str(table["error"][1]).startswith("the motion diverged (beyond 0.001 m) at ")
    assert (
        list(table["error"][2:])
        == ["law.alpha = -1.0 is not allowed: it must be a finite number >= 1e-12 and <= 1e+12"] * 2
    )
    assert table["rms_x"].isna().tolist() == table["ticks"].isna().tolist() == [False, True, True, True]


def test_set_that_cannot_be_computed_with_is_a_row_too(cluster):
    table = sweep(scenario(), {"afm_controller_node.scanner.f_x": [669.07, 1e-200]}, scheduler=cluster, progress=False)
    assert table["error"].isna().tolist() == [True, False]
    assert table["error"][1].startswith("scanner.f_x = 1e-200 Hz is not allowed: it must be a finite number >= 1e-07")


def test_tip_that_does_not_touch_and_endless_run_are_rows_too(cluster):
    values = {"afm_sim_node.cantilever.a": [1.0], "afm_sim_node.run.duration": [1e-3, 0.0]}
    table = sweep(scenario(), values, scheduler=cluster, progress=False)
    assert "does not touch" in table["error"][0]
    values = {"afm_sim_node.run.duration": [0.0]}
    assert "run.duration = 0 s" in sweep(scenario(), values, progress=False)["error"][0]


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("law.alpha", ALPHA),
        ("seed", SEED),
        ("afm_sim_node.law.alpha", ALPHA),
        ("afm_sim_node.plant.delay_tick", DELAY),
        ("plant.sed", SEED),
    ],
)
def test_unknown_name_is_refused_with_the_nearest(name, near):
    with pytest.raises(ParameterError, match=re.escape(f"unknown parameter {name}: did you mean {near}?")):
        sweep(scenario(), {name: [1.0]})


@pytest.mark.parametrize(
    ("values", "options", "words"),
    [
        ({ALPHA: 10.0}, {}, "must be a list of values"),
        ({"afm_controller_node.law.kind": "tanh"}, {}, "must be a list of values"),
        ({SEED: [[1], 2]}, {}, "a value is a number"),
        ({ALPHA: [1.0, 2.0], SEED: [1]}, {"grid": False}, "the same number of values"),
        ({ALPHA: [1.0]}, {"workers": 0}, "workers = 0 is not allowed"),
        ({ALPHA: [1.0]}, {"workers": 2, "scheduler": "tcp://localhost:1"}, "not given with a scheduler"),
    ],
)
def test_what_does_not_fit_is_refused_before_anything_runs(values, options, words):
    with pytest.raises(ParameterError, match=words):
        sweep(scenario(), values, **options)


def test_numbers_of_numpy_are_numbers(cluster):
    table = sweep(scenario(), {ALPHA: np.array([10.0]), SEED: np.arange(2)}, scheduler=cluster, progress=False)
    assert table["error"].isna().all()


def test_nothing_to_run_is_an_empty_table_and_no_parameter_is_the_scenario(cluster):
    assert len(sweep(scenario(), {ALPHA: []}, progress=False)) == 0
    table = sweep(scenario(), {}, scheduler=cluster, fingerprint=True, progress=False)
    assert (
        table["trajectory_sha256"][0] == simulate(build(SimParameters, SIM), ControllerParameters()).trajectory_sha256
    )


def test_fingerprint_changes_nothing_else(cluster):
    whole = sweep(scenario(), {SEED: [1, 2]}, scheduler=cluster, fingerprint=True, progress=False)
    table = sweep(scenario(), {SEED: [1, 2]}, scheduler=cluster, progress=False)
    pd.testing.assert_frame_equal(table, whole.drop(columns="trajectory_sha256"))


@pytest.mark.long
def test_memory_does_not_grow_with_the_number_of_sets(monkeypatch):
    # Scheduler and client are in this process: whatever keeps the sets shows here.
    monkeypatch.setattr(sys.modules["afm_model.studies.scatter"], "_AHEAD", 16)
    monkeypatch.setattr(sys.modules["afm_model.studies.sweep"], "_CHECKED", 16)
    alive: list[int] = []

    def count(done: int, total: int) -> None:
        if done % 32 == 0:
            alive.append(sum(type(each).__name__ == "SimParameters" for each in gc.get_objects()))

    base = scenario(**{"run.duration": 4e-5, "score.start": 0.0})
    sweep(base, {SEED: range(256)}, workers=1, progress=count)
    # In the worker: those that are looked at, checked, or waiting in tasks.
    assert max(alive) - alive[0] <= (1 + 1 + 5) * 16


def test_progress_counts_runs_to_the_last_refused_ones_included(cluster):
    calls: list[tuple[int, int]] = []
    values = {SEED: [-1, *range(19)]}
    sweep(scenario(), values, scheduler=cluster, progress=lambda done, total: calls.append((done, total)))
    assert calls[0] == (0, 20) and calls[-1] == (20, 20)
    assert calls == sorted(calls)


def test_worker_with_other_sources_is_refused(cluster, monkeypatch):
    # Workers read the fingerprint of their own process, which is this one here: it changes on the way to them.
    answers = iter(["those of the sweep", "those of the worker"])
    monkeypatch.setattr(kernel_cache, "fingerprint", lambda module, file: next(answers))
    with pytest.raises(SweepError, match="a worker has other sources"):
        sweep(scenario(), {SEED: [1]}, scheduler=cluster, progress=False)


def test_scheduler_that_is_not_there_is_told(monkeypatch):
    monkeypatch.setattr(sys.modules["afm_model.studies.scatter"], "_TIMEOUT", 0.2)
    with pytest.raises(SweepError, match=r"no Dask scheduler answers at tcp://127.0.0.1:1"):
        sweep(scenario(), {SEED: [1]}, scheduler="tcp://127.0.0.1:1", progress=False)


@pytest.mark.parametrize("package", ["distributed", "pandas"])
def test_missing_package_is_told_in_a_sentence(monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(SweepError, match=f"a sweep needs dask, distributed and pandas .*{package}.*: pip install"):
        sweep(scenario(), {SEED: [1]})


def python(*arguments: str, **options: object) -> subprocess.Popen[str]:
    """Python in a process, and a session, of its own."""
    path = os.pathsep.join([str(Path(kernel_cache.__file__).resolve().parents[1]), os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, *arguments],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        **options,
    )


def left_of(leader: int) -> list[str]:
    """Processes of a session that still run, when each has had time to notice that its parent has ended."""
    limit = time.monotonic() + 30.0
    while (left := running_in(leader)) and time.monotonic() < limit:
        time.sleep(0.05)
    return left


def running_in(leader: int) -> list[str]:
    """Processes of a session."""
    left = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, rest = path.read_text().rsplit(")", 1)
        except (FileNotFoundError, ProcessLookupError):
            continue
        status, _, _, session, *_ = rest.split()
        if int(session) == leader and status != "Z":
            left.append(name)
    return left


def test_example_of_the_docs_prints_what_they_say_and_leaves_no_process(tmp_path):
    text = (ROOT / "docs" / "sweep.md").read_text()
    program, printed = re.search(r"```python\n(.*?)```\n\nprints\n\n```\n(.*?)```", text, re.DOTALL).groups()
    script = tmp_path / "example.py"
    script.write_text(program)
    with socket.socket() as taken:
        # The port that Dask would serve at; if another cluster has it already, as good.
        with suppress(OSError):
            taken.bind(("127.0.0.1", 8787))
            taken.listen()
        run = python(str(script))
        out, told = run.communicate(timeout=400)
    assert run.returncode == 0, told
    assert "Warning" not in told
    assert [line.rstrip() for line in out.splitlines()] == printed.splitlines()
    assert left_of(run.pid) == []


SCRIPT = """
from afm_model import sweep
from afm_model.parameters.scenario import Scenario
from afm_model.parameters import SimParameters, build

if __name__ == "__main__":
    sim = build(SimParameters, {"run.duration": 0.1})
    tell = lambda done, total: print(done, flush=True)
    sweep(Scenario("long", None, sim=sim), {"afm_sim_node.plant.seed": range(1000)}, workers=1, progress=tell)
"""


def test_ctrl_c_ends_the_sweep_and_its_processes_without_a_word_of_theirs(tmp_path):
    script = tmp_path / "long.py"
    script.write_text(SCRIPT)
    run = python(str(script))
    assert run.stdout is not None
    # Some runs are done, others under way.
    assert run.stdout.readline() == "0\n" and run.stdout.readline() != ""
    os.killpg(run.pid, signal.SIGINT)
    _, told = run.communicate(timeout=400)
    assert run.returncode == -signal.SIGINT
    assert told.count("Traceback") == 1 and told.endswith("KeyboardInterrupt\n")
    assert left_of(run.pid) == []


def test_script_without_a_guard_is_told_in_the_worker_that_reads_it_and_in_itself(monkeypatch):
    def refuse(**_: object) -> None:
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr(distributed, "LocalCluster", refuse)
    monkeypatch.setattr(resource_tracker, "ensure_running", lambda: None)  # a process for nothing
    with pytest.raises(SweepError, match=r'no worker process .*Nanny.* under if __name__ == "__main__":'):
        sweep(scenario(), {SEED: [1]}, progress=False)
    # So does multiprocessing mark a process that still reads the script of its parent.
    monkeypatch.setattr(multiprocessing.current_process(), "_inheriting", True, raising=False)
    with pytest.raises(SweepError, match=r'^in a script, sweep must be called under if __name__ == "__main__":'):
        sweep(scenario(), {SEED: [1]}, progress=False)


def test_laws_of_every_kind_are_swept_each_made_for_the_plant_of_its_set(cluster):
    kind, period = "afm_controller_node.law.kind", "afm_sim_node.plant.control_period"
    sets = {kind: ["sgn", "pid", "observer"], period: [4e-6, 2e-5]}
    base = scenario(**{"detector.noise": 0.0, "detector.position_noise": 0.0, "detector.sample_period": 1e-6})
    table = sweep(base, sets, scheduler=cluster, fingerprint=True, progress=False)
    assert table["error"].isna().all()
    for _, row in table[table[kind] != "sgn"].iterrows():
        sim = changed(base.sim, {"plant.control_period": row[period]})
        own = {"law.kind": row[kind], "law.period": row[period]}
        assert row["trajectory_sha256"] == simulate(sim, build(ControllerParameters, own)).trajectory_sha256


def test_law_that_is_left_at_another_period_is_warned_of_and_run(cluster):
    sets = {
        "afm_controller_node.law.kind": ["observer"],
        "afm_controller_node.law.period": [1e-5],
        "afm_controller_node.law.delay_ticks": [0],
    }
    with pytest.warns(TimingWarning, match=r"in 1 of 1 sets the law is made for another rate: law.period = 1e-05 s"):
        table = sweep(scenario(), sets, scheduler=cluster, progress=False)
    assert table["error"].isna().all()
