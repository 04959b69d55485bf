"""Claims about the environment for those who learn laws: gymnasium's own checker, the bits of `simulate`, no truth."""

import re
import runpy
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from afm_model import Controller, ParameterError, load_scenario, simulate
from afm_model.parameters import changed
from afm_model.parts.signals import Measurement

pytest.importorskip("gymnasium")
import gymnasium
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

from afm_model.studies.learning import ID, OBSERVATION, TrackingEnv, TrackingVectorEnv, rewards

SHORT = {"run.duration": 5e-3, "score.start": 0.0, "detector.noise": 1e-3, "detector.sample_period": 5e-5}
TICKS = 100


@pytest.fixture(scope="module")
def scenario():
    found = load_scenario("closed_loop_predictive")
    law = changed(found.controller, {"law.kind": "observer", "law.period": 5e-5}, afresh=("law",))
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


NAME = f"afm_model.studies.learning:{ID}"


def test_checker_of_gymnasium_passes_without_a_warning_by_the_registered_name_pictures_included(scenario):
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*", UserWarning)
        check_env(gymnasium.make(NAME, scenario=scenario, render_mode="rgb_array").unwrapped)


def test_registered_name_makes_one_environment_or_many():
    # Without a scenario: that of the page.
    with gymnasium.make(NAME) as env:
        assert isinstance(env.unwrapped, TrackingEnv)
        seen, _ = env.reset(seed=3)
    envs = gymnasium.make_vec(NAME, num_envs=2)
    assert isinstance(envs.unwrapped, TrackingVectorEnv)
    both, _ = envs.reset(seed=3)
    assert np.array_equal(both[0], seen)


def test_picture_shows_the_episode_up_to_now(scenario):
    env = TrackingEnv(scenario, render_mode="rgb_array")
    with pytest.raises(ResetNeeded, match="call reset first"):
        env.render()
    env.reset(seed=1)
    start = env.render()
    assert (start.shape, start.dtype) == ((570, 720, 3), np.uint8)
    for _ in range(5):
        env.step(np.zeros(3))
    later = env.render()
    assert not np.array_equal(start, later)
    assert np.array_equal(later, env.render())
    assert TrackingEnv(scenario).render() is None
    with pytest.raises(ParameterError, match="render_mode = human is not allowed"):
        TrackingEnv(scenario, render_mode="human")


def test_step_before_reset_and_behind_the_end_of_an_episode_is_refused_in_a_sentence(scenario):
    env = TrackingEnv(scenario, hold=TICKS)
    with pytest.raises(ResetNeeded, match="before the first episode has started: call reset first"):
        env.step(np.zeros(3))
    with pytest.raises(ResetNeeded, match="before the first episode has started: call reset first"):
        TrackingVectorEnv(scenario, 2).step(np.zeros((2, 3)))
    env.reset(seed=1)
    _, _, terminated, truncated, _ = env.step(np.zeros(3))
    assert (terminated, truncated) == (False, True)
    with pytest.raises(ResetNeeded, match="after the end of an episode: call reset first"):
        env.step(np.zeros(3))
    env.reset(seed=1)
    env.step(np.zeros(3))


@pytest.mark.parametrize("largest", [1.001, -4.0, 20.0])
def test_action_outside_its_box_is_refused_with_what_is_allowed_and_changes_nothing(scenario, largest):
    env = TrackingEnv(scenario)
    env.reset(seed=1)
    with pytest.raises(ValueError, match=rf"action {largest:g} is not allowed: it must be >= -1 and <= 1, .* 4 V"):
        env.step(np.array([0.0, largest, 1.0]))
    seen = env.step(np.ones(3, np.float32))[0]
    env.reset(seed=1)
    assert np.array_equal(seen, env.step(np.ones(3))[0])


@pytest.mark.parametrize("kind", [TrackingEnv, TrackingVectorEnv])
def test_options_of_a_reset_are_refused_and_end_no_episode(scenario, kind):
    env = kind(scenario)
    env.reset(seed=1)
    action = np.zeros(env.action_space.shape)
    with pytest.raises(ParameterError, match="options gain are not allowed: reset takes a seed, and nothing else"):
        env.reset(seed=2, options={"gain": 1.0})
    seen = env.step(action)[0]
    env.reset(seed=1, options={})
    assert np.array_equal(seen, env.step(action)[0])


def test_actions_have_the_type_that_learners_have():
    """Stable-Baselines3 warns of another one; drives in double precision are put in force as they are."""
    assert TrackingEnv().action_space.dtype == TrackingVectorEnv(num_envs=2).action_space.dtype == np.float32


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


@pytest.mark.long
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
