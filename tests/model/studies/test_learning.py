"""Claims about the environment for those who learn laws: gymnasium's own checker, the bits of `simulate`, no truth."""

import re
import runpy
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from afm_model import Controller, load_scenario, simulate
from afm_model.parameters import changed
from afm_model.parts.signals import Measurement

pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env

from afm_model.studies.learning import OBSERVATION, TrackingEnv, TrackingVectorEnv, rewards

SHORT = {"run.duration": 5e-3, "score.start": 0.0, "detector.noise": 1e-3, "detector.sample_period": 5e-5}
TICKS = 100


@pytest.fixture(scope="module")
def scenario():
    found = load_scenario("closed_loop_predictive")
    law = changed(found.controller, {"law.kind": "observer", "law.period": 5e-5}, anew=("law",))
    return replace(found, sim=changed(found.sim, SHORT), controller=law)


def episode(envs, scenario, seed):
    """An episode in which each instrument is driven by the law; what each step has returned."""
    laws = [Controller(scenario.controller) for _ in range(envs.num_envs)]
    seen, infos = envs.reset(seed=seed)
    steps = []
    while not steps or not steps[-1][3].any():
        drives = [law.answer(engine.instrument.measurement) for law, engine in zip(laws, envs._engines, strict=True)]
        steps.append(envs.step(np.array(drives) / 4.0))
    return seen, infos, steps


@pytest.mark.parametrize("num_envs", [3, 40])
def test_drives_of_a_law_give_the_bits_of_its_simulation(scenario, num_envs):
    """One by one, and in two blocks of lanes."""
    envs = TrackingVectorEnv(scenario, num_envs, vary=lambda random: {"contact.tau": random.uniform(0.8e9, 1.2e9)})
    seen, infos, steps = episode(envs, scenario, seed=5)
    assert len(steps) == TICKS
    hashes = steps[-1][4]["trajectory_sha256"]
    assert len({*hashes}) == num_envs
    for number in (0, num_envs - 1):
        random = np.random.default_rng(5 + number)
        seed = int(random.integers(2**31))
        assert infos["seed"][number] == seed
        sim = changed(scenario.sim, {"plant.seed": seed, "contact.tau": random.uniform(0.8e9, 1.2e9)})
        alone = simulate(sim, scenario.controller)
        assert hashes[number] == alone.trajectory_sha256
        # Behind action k stands measurement k + 1.
        observed = np.array([step[0][number] for step in steps[:-1]])
        assert np.array_equal(observed[:, OBSERVATION.index("deflection")], 1e9 * alone.deflection[1:])
        earned = [step[1][number] for step in steps[:-1]]
        assert np.array_equal(earned, rewards(alone.measurements[1:], 5e-9))
        assert min(earned) < 0.0
    again, _, others = episode(envs, scenario, seed=5)
    assert np.array_equal(seen, again)
    assert all(np.array_equal(a[0], b[0]) for a, b in zip(steps, others, strict=True))


def test_checker_of_gymnasium_passes(scenario):
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*", UserWarning)
        warnings.filterwarnings("ignore", ".*space (minimum|maximum) value is")
        check_env(TrackingEnv(scenario), skip_render_check=True)


def test_only_what_a_controller_measures_is_observed(scenario):
    fields = {name.rpartition("_")[0] if name[-2:] in ("_x", "_y", "_z") else name for name in OBSERVATION}
    assert fields <= set(Measurement.names)
    quiet = TrackingVectorEnv(replace(scenario, sim=changed(scenario.sim, {"detector.noise": 0.0})), 2)
    assert np.array_equal(*quiet.reset(seed=1)[0])
    noisy = TrackingVectorEnv(scenario, 2).reset(seed=1)[0]
    differ = [name for name, one, other in zip(OBSERVATION, *noisy, strict=True) if one != other]
    assert set(differ) == {"deflection", "lateral_force"}


@pytest.mark.parametrize("num_envs", [2, 8])
def test_an_instrument_that_diverges_ends_and_begins_anew_and_the_others_go_on(scenario, num_envs):
    envs = TrackingVectorEnv(scenario, num_envs, drive_range=2.0**20, hold=4)
    observations, _ = envs.reset(seed=0)
    kept = 2.0**-20 * observations[:, [OBSERVATION.index(f"drive_{axis}") for axis in "xyz"]]
    wild, ends = kept.copy(), 0
    wild[0] = 1.0
    for number in range(TICKS // 4):
        observations, reward, terminated, truncated, infos = envs.step(wild)
        assert np.isfinite(observations).all()
        assert not terminated[1:].any()
        assert truncated[1:].all() == (number == TICKS // 4 - 1)
        if terminated[0]:
            ends += 1
            assert "diverged" in infos["error"][0]
            # Never better than to go on as badly as can be.
            assert reward[0] <= -(TICKS // 4 - number)
            break
    assert ends == 1
    observations, reward, terminated, truncated, infos = envs.step(kept)
    assert reward[0] == 0.0 and infos["_seed"].tolist() == [True] + [False] * (num_envs - 1)
    assert not terminated.any()


def test_an_action_that_is_no_number_is_refused(scenario):
    envs = TrackingVectorEnv(scenario, 2)
    envs.reset(seed=0)
    with pytest.raises(ValueError, match="finite"):
        envs.step(np.full((2, 3), np.nan))


def test_example_learns_and_its_page_has_the_scores_to_beat(monkeypatch, capsys):
    root = Path(__file__).resolve().parents[3]
    monkeypatch.setattr(sys, "argv", ["learn_tracking.py", "--rounds", "3"])
    runpy.run_path(str(root / "examples" / "learn_tracking.py"), run_name="__main__")
    said = capsys.readouterr().out
    best = [float(each) for each in re.findall("best (-[0-9.]+)", said)]
    assert best[2] > best[0]
    page = (root / "docs" / "controllers.md").read_text()
    rows = dict(re.findall(r"^\| ([a-z, ]+) \| (-[0-9.e-]+) \|", page, re.MULTILINE))
    found = dict(re.findall(r"^\| ([a-z, ]+) \| (-[0-9.e-]+) \|", said, re.MULTILINE))
    assert list(found) == list(rows) and len(found) == 5
    for law in set(found) - {"learnt"}:
        assert float(found[law]) == pytest.approx(float(rows[law]), rel=0.2)
