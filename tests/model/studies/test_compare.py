"""Claims about comparisons: each row is the single run; what diverges, refuses or raises is a result; ranks; files."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from afm_model import (
    Comparison,
    ControllerParameters,
    ParameterError,
    Scenario,
    SimParameters,
    build,
    compare,
    load_scenario,
    simulate,
)
from afm_model.core.registry import names
from afm_model.run.simulation import run
from afm_model.studies import contender
from afm_model.studies.trial import Drives
from afm_model.studies.unranked import height_limit

from .short import SHORT


@pytest.fixture(scope="module")
def some(cluster) -> Comparison:
    """Three laws, one of which diverges with a delay of two periods."""
    return compare(
        ["observer", "pid", "sgn"],
        periods=[5e-5],
        delay_ticks=[0, 2],
        noise=[0, 1],
        scheduler=cluster,
        **SHORT,
    )


def test_every_law_runs_under_every_combination_once(some):
    table = some.table
    assert len(table) == 3 * 2 * 2
    assert not table.duplicated(["law", "period", "delay_ticks", "noise", "friction", "reference"]).any()


def test_row_is_the_single_run_from_its_scenario_to_the_last_bit(some, tmp_path):
    number = 3  # with delay and noise
    row = some.table.iloc[number]
    assert (row["law"], row["delay_ticks"], row["noise"]) == ("observer", 2, 1)
    path = tmp_path / "row.yaml"
    path.write_text(yaml.safe_dump({key: {"ros__parameters": each} for key, each in some.scenario_of(number).items()}))
    scenario = load_scenario(path)
    single = simulate(scenario.sim, scenario.controller)
    assert single.trajectory_sha256 == row["trajectory_sha256"]
    assert row["error_max"] == pytest.approx(max(single.score.max_percent[:2]))
    assert row["tip_force"] == max(abs(force) for force in single.score.normal_force)


def test_divergence_is_a_result_and_ranks_last(some):
    lost = some.table[some.table["error"].str.contains("diverged", na=False)]
    assert set(lost["law"]) == {"sgn"}
    assert lost["error_max"].isna().all()
    ranking = some.ranking()
    assert ranking["law"].iloc[-1] == "sgn"
    assert ranking.set_index("law").loc["sgn", "finished"] == 0


def test_ranks_follow_the_numbers(some):
    ranking = some.ranking()
    for name in ("error_max", "chatter", "energy", "tip_force"):
        ordered = ranking.sort_values(f"rank_{name}")[name].tolist()
        assert ordered == sorted(ordered)
    assert ranking["rank_margin"].iloc[ranking["margin"].argmax()] == 1


def test_margin_of_a_law_that_switches_is_missing_and_of_the_others_the_same_with_noise(some):
    table = some.table
    assert table[table["law"] == "sgn"]["margin"].isna().all()
    for _, runs in table[table["law"] != "sgn"].groupby(["law", "delay_ticks"]):
        assert runs["margin"].nunique() == 1 and runs["margin"].iloc[0] > 0.0


def test_chatter_of_a_smooth_drive_is_one(cluster):
    table = compare(["implicit"], periods=[2e-6], references=["sine 500"], scheduler=cluster, progress=False).table
    assert 0.95 < table["chatter"].iloc[0] < 1.2  # friction itself varies by some percent


def test_chatter_of_drives_held_from_tick_to_tick_is_their_variation_over_that_of_a_smooth_one(cluster):
    compared = compare(["pid"], periods=[2e-5], scheduler=cluster, **SHORT)
    sections = compared.scenario_of(0)
    sim = build(SimParameters, sections["/**/afm_sim_node"])
    drives, blocks = Drives(sim), []
    instrument = run(sim, build(ControllerParameters, sections["/**/afm_controller_node"]), blocks.append)
    for block in blocks:
        drives.take(block)
    held = np.concatenate([block.drives for block in blocks])[sim.score_tick :, :2]
    assert instrument.score().ticks == len(held)
    variation = np.abs(np.diff(held, axis=0)).sum()
    assert compared.table["chatter"].iloc[0] == pytest.approx(variation / drives.smooth_variation, rel=1e-9)


def test_a_horizon_that_shakes_between_the_ticks_chatters(cluster, own, tmp_path, monkeypatch):
    (tmp_path / "shaking.py").write_text(
        "import numpy as np\n"
        "from pd_class import Pd\n"
        "from afm_model import Command\n"
        "class Quiet(Pd):\n"
        "    shake = 0.0  # [V]\n"
        "    def answer(self, measurement):\n"
        "        drive = super().answer(measurement)\n"
        "        signs = np.array([1, -1, 1, -1, 1, -1, 1, -1, 0.0])\n"
        "        return Command(drive, drive + np.outer(signs, [self.shake, self.shake, 0.0]), 5e-6)\n"
        "class Shaking(Quiet):\n"
        "    shake = 0.5\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    fine = {"plant.control_period": 5e-5, "piezo.dac_period": 5e-6}
    scenario = Scenario("fine", Path("fine.yaml"), sim=build(SimParameters, fine))
    laws = ["pd_class:Pd", "shaking:Quiet", "shaking:Shaking"]
    held, quiet, shaking = compare(laws, scenario, periods=[5e-5], scheduler=cluster, **SHORT).table["chatter"]
    assert quiet == held
    assert shaking > 20.0 * quiet


def test_law_and_class_of_ones_own_take_part_and_agree(cluster, own):
    table = compare(["pd_law:PD", "pd_class:Pd"], periods=[5e-5], delay_ticks=[1], scheduler=cluster, **SHORT).table
    assert table["error"].isna().all()
    # The same but for round-off, which friction does not enlarge in so short a run.
    assert table["error_max"].iloc[0] == pytest.approx(table["error_max"].iloc[1], rel=1e-6)
    assert table["margin"].notna().tolist() == [True, False]


@pytest.mark.parametrize(
    ("volts", "words"), [(-10.0, "the tip was on the sample for"), (500.0, "the normal force rose to")]
)
def test_a_law_that_lifts_the_tip_or_presses_it_beyond_what_is_valid_wins_nothing(
    cluster, tmp_path, monkeypatch, volts, words
):
    # The scanner without friction: feedforward alone is exact.
    (tmp_path / f"lifting{volts:.0f}.py".replace("-", "_")).write_text(
        "import numpy as np\n"
        "from afm_model.parts import record_at\n"
        "from afm_model.parts.signals import Measurement\n"
        "class Lift:\n"
        "    def __init__(self, sim):\n"
        "        self.sensitivity = sim.piezo.sensitivity_x\n"
        "    def answer(self, measurement):\n"
        "        r = record_at(measurement, 0, Measurement).reference_position\n"
        f"        return np.array([r[0] / self.sensitivity, r[1] / self.sensitivity, {volts}])\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    law = f"lifting{volts:.0f}:Lift".replace("-", "_")
    compared = compare([law, "observer"], periods=[5e-5], scheduler=cluster, progress=False)
    cheat = compared.table.iloc[0]
    assert cheat["error"].startswith(words) and "not ranked" in cheat["error"]
    ranking = compared.ranking()
    assert ranking["law"].iloc[-1] == law
    assert ranking.set_index("law").loc[law, "finished"] == 0


PULLING = """
import numpy as np
from afm_model import ControllerParameters, build
from afm_model.parts import record_at
from afm_model.instrument.controller import Controller
from afm_model.parts.signals import Measurement
class Honest:
    pull = 0.0  # [N]
    def __init__(self, sim):
        timing = {"law.period": sim.plant.control_period, "law.delay_ticks": sim.plant.delay_ticks}
        self.law = Controller(build(ControllerParameters, {"law.kind": "super_twisting"} | timing))
        self.stiffness = sim.cantilever.m_c * (2.0 * np.pi * sim.cantilever.f_c) ** 2
        self.ticks = 0
    def answer(self, measurement):
        told = measurement.copy()
        self.ticks += 1
        record_at(told, 0, Measurement).reference_position[2] += self.pull / self.stiffness * min(1, self.ticks / 600)
        return self.law.answer(told).copy()
class Pull(Honest):
    pull = -140e-9
"""


def test_a_law_that_pulls_at_the_tip_so_that_friction_falls_is_not_ranked(cluster, tmp_path, monkeypatch):
    (tmp_path / "pulling.py").write_text(PULLING)
    monkeypatch.syspath_prepend(str(tmp_path))
    conditions = {"periods": [5e-5], "delay_ticks": [1], "references": ["sine 500"], "scheduler": cluster}
    compared = compare(["pulling:Pull", "pulling:Honest"], **conditions, progress=False)
    pulled, honest = compared.table.to_dict("records")
    assert pulled["error_max"] < honest["error_max"]
    assert "the tip was off the height that was asked by" in pulled["error"]
    assert "12.5 and 50 nm are allowed: this run is not ranked" in pulled["error"]
    assert not isinstance(honest["error"], str)
    assert compared.ranking()["law"].tolist() == ["pulling:Honest", "pulling:Pull"]


def test_a_law_that_leaves_z_as_it_is_is_ranked(cluster, own):
    # The tip rides over the sample: off by no more than the sample is high.
    run = compare(["pd_law:PD slowness=2"], periods=[5e-5], scheduler=cluster, progress=False).table.iloc[0]
    assert run["z_rms"] > 9e-9 and not isinstance(run["error"], str)


@pytest.mark.parametrize(
    ("sample", "allowed"),
    [
        ({}, 12.5e-9),
        ({"sample.beta": 25e-9}, 25e-9),
        ({"sample.kind": "flat"}, 0.1 * 152.3e-9 / 1.364),
    ],
)
def test_height_may_be_off_by_that_of_the_sample_or_by_a_tenth_of_the_pull_off_force(sample, allowed):
    assert height_limit(build(SimParameters, sample)) == pytest.approx(allowed, rel=1e-3)


def test_friction_and_noise_are_told_to_no_law(cluster):
    comparison = compare(["implicit"], friction=[0.8, 1.2], noise=[1.0], scheduler=cluster, **SHORT)
    laws = [comparison.scenario_of(i)["/**/afm_controller_node"] for i in range(2)]
    assert laws[0] == laws[1] == {"law.kind": "implicit", "law.period": 5e-5}
    plants = [comparison.scenario_of(i)["/**/afm_sim_node"]["contact.tau"] for i in range(2)]
    assert plants == [0.8 * 0.91e9, 1.2 * 0.91e9]


@pytest.mark.parametrize(
    ("laws", "conditions", "words"),
    [
        (["pidd"], {}, "there is no law pidd: it must be one of open_loop"),
        (["pid speed=2"], {}, "unknown parameter law.speed"),
        (["pid slowness"], {}, "law pid slowness: slowness is not allowed: a parameter is given as name=value"),
        (["pid slowness=-1"], {}, "law.slowness = -1 is not allowed"),
        (["math:tau"], {}, "law math:tau is not a law part and not a class"),
        (["nowhere:Law"], {}, "law nowhere:Law cannot be loaded: ModuleNotFoundError"),
        (["pid", "pid"], {}, "a law is given twice"),
        (["pid", " pid"], {}, "a law is given twice"),
        (["pid"], {"references": ["sine"]}, "reference sine is not allowed: it must be a shape and"),
        (["pid"], {"references": ["square 50"]}, "reference.shape_x = square is not allowed"),
        (["pid"], {"periods": [1.5e-6]}, "plant.control_period = 1.5e-06 s is not allowed"),
        (["pid"], {"cycles": 0.5}, "cycles = 0.5 is not allowed: it must be > 0.5"),
    ],
)
def test_what_is_not_allowed_is_told_in_a_sentence_before_anything_runs(laws, conditions, words):
    with pytest.raises(ParameterError) as raised:
        compare(laws, scheduler="tcp://127.0.0.1:1", progress=False, **conditions)
    assert words in str(raised.value)


def test_parameters_of_a_law_are_read_as_they_are_written():
    assert contender("tanh alpha=0.4").values == {"alpha": 0.4}
    assert contender("pid feedforward=false z=pid").values == {"feedforward": False, "z": "pid"}
    assert contender("sgn").knowledge.startswith("positions and velocities")


def test_what_a_period_does_not_allow_is_refused_there_alone(cluster):
    # 400 periods of 2 us, 16 of 50.
    runs = compare(["predictive response=8e-4"], periods=[2e-6, 5e-5], scheduler=cluster, **SHORT).table
    refused, allowed = runs["error"]
    assert "law.period = 2e-06 s is not allowed" in refused and "not allowed" not in allowed


def test_table_is_kept_as_csv_and_ranking_as_latex(some, tmp_path):
    some.to_csv(tmp_path / "table.csv")
    rows = list(csv.DictReader((tmp_path / "table.csv").open()))
    assert [float(row["energy"] or "nan") for row in rows] == pytest.approx(list(some.table["energy"]), nan_ok=True)
    latex = some.to_latex()
    assert r"sgn & 4 & 0 &" in latex
    body = [line for line in latex.splitlines() if line.endswith(r"\\")]
    assert len(body) == 4 and {line.count("&") for line in body} == {7}


def test_a_law_that_is_tuned_is_the_best_of_its_settings_over_the_same_runs(cluster):
    conditions = {"periods": [5e-5], "delay_ticks": [0, 1], "references": ["sine 500"], "scheduler": cluster}
    each = compare(["pid", "pid slowness=0.3", "pid slowness=4"], **conditions, progress=False).ranking()
    tuned = compare(["pid slowness=0.3,1,4", "observer"], **conditions, progress=False)
    assert len(tuned.table) == 2 * 2 and len(tuned.contenders) == 2
    row = tuned.ranking().set_index("law").loc["pid slowness=0.3 (tuned: best of 3)"]
    assert row["error_max"] == each["error_max"].iloc[0]
    assert each["law"].iloc[0] == "pid slowness=0.3"


def test_an_axis_at_rest_counts_and_gives_a_number(cluster):
    scenario = Scenario("x alone", Path("x.yaml"), sim=build(SimParameters, {"reference.amplitude_y": 0.0}))
    run = compare(["tanh alpha=0.4"], scenario, periods=[2e-6], scheduler=cluster, **SHORT).table.iloc[0]
    assert 1.0 < run["error_max"] < 100.0 and math.isfinite(run["error_rms"])


def test_every_law_says_what_it_is_told():
    for name in names("law"):
        if name not in ("open_loop", "chirp", "external"):
            assert "scanner" in contender(name).knowledge, name
