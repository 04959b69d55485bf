"""The environment of a scan: gymnasium's own checker, what its rewards are made of, no truth in what is observed."""

import warnings

import numpy as np
import pytest

from afm_model import ParameterError

pytest.importorskip("gymnasium")
import gymnasium
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

from afm_model.studies.learning import SCAN_ID
from afm_model.studies.scan_line import COSTS, ScanLineEnv

SLOW, MIDDLE = np.array([0.3, -1.0, -0.5, -1.0]), np.zeros(4)


def surface(random: np.random.Generator) -> dict:
    """One surface, whatever the seed."""
    return {"sample.surface_seed": 7, "sample.rms": 5e-9, "sample.correlation": 80e-9, "plant.Q_scanner": 20.0}


@pytest.fixture(scope="module")
def env() -> ScanLineEnv:
    return ScanLineEnv(lines=3, vary=surface, render_mode="rgb_array")


def test_checker_of_gymnasium_passes_without_a_warning_by_the_registered_name_pictures_included() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = gymnasium.make(f"afm_model.studies.learning:{SCAN_ID}", lines=3, render_mode="rgb_array")
        check_env(made.unwrapped)
    envs = gymnasium.make_vec(f"afm_model.studies.learning:{SCAN_ID}", num_envs=2, lines=3)
    seen, _ = envs.reset(seed=3)
    assert seen.shape == (2, 11) and envs.action_space.shape == (2, 4)


def test_a_seed_gives_the_same_episode_and_another_one_another_surface() -> None:
    env = ScanLineEnv(lines=1)

    def episode(seed: int) -> tuple:
        seen, info = env.reset(seed=seed)
        return seen.tolist(), env.step(SLOW)[1], info["parameters"]["sample.rms"]

    first, other = episode(1), episode(2)
    assert first == episode(1)
    assert all(one != another for one, another in zip(first, other, strict=True))


def test_a_slow_line_shows_the_true_height_and_a_fast_one_costs_height_and_saves_time(env: ScanLineEnv) -> None:
    env.reset(seed=1)
    _, reward, *_, info = env.step(SLOW)
    slow = env.last
    assert slow is not None
    assert slow.true_height.std() > 1e-9
    # Both ways the loop is late, to opposite sides.
    assert np.corrcoef(slow.height.mean(axis=0), slow.true_height.mean(axis=0))[0, 1] > 0.995
    wrong = np.sqrt(np.mean((slow.height - slow.true_height) ** 2))
    np.testing.assert_allclose(info["costs"], np.array([wrong, abs(slow.force).max(), slow.time]) / COSTS)
    assert reward == -info["costs"].sum()
    # A line at 4 Hz, and the way to it; a force of 2 nN and what the loop does not follow: 0.2 N/m.
    assert 0.25 < slow.time < 0.3
    assert slow.force.mean() == pytest.approx(1e-9 * (20.0**0.25), rel=0.05)
    fast = env.step([0.3, -1.0, -0.5, 1.0])
    assert fast[-1]["costs"][0] > 2.0 * info["costs"][0] and fast[-1]["costs"][2] < 0.2 * info["costs"][2]
    assert env.step([0.3, -1.0, 1.0, -1.0])[-1]["costs"][1] == pytest.approx(1.0, abs=0.1)


def test_what_is_observed_does_not_depend_on_the_truth(env: ScanLineEnv) -> None:
    seen, _ = env.reset(seed=1)
    line = env.last
    assert line is not None
    blind = line._replace(true_height=0.0 * line.true_height, force=0.0 * line.force)
    np.testing.assert_array_equal(blind.seen, line.seen)
    np.testing.assert_array_equal(seen[6:], [0.0, 0.0, 0.0, 0.0, 0.0])


def test_a_gain_at_which_the_loop_oscillates_is_seen_as_ringing() -> None:
    env = ScanLineEnv(vary=lambda random: surface(random) | {"plant.Q_scanner": 40.0})
    calm = env.reset(seed=1)[0]
    ringing = env.step([1.0, -1.0, 0.0, 0.0])
    assert ringing[0][2] > calm[2] + 0.3 and ringing[1] < -3.0


def test_settings_outside_their_range_and_options_are_refused_and_change_nothing(env: ScanLineEnv) -> None:
    env.reset(seed=1)
    for action, message in (([0.0, 1.5, 0.0, 0.0], "action 1.5 is not allowed: .*SETTINGS"), ([np.nan] * 4, "finite")):
        with pytest.raises(ValueError, match=message):
            env.step(action)
    with pytest.raises(ParameterError, match="options surface are not allowed: reset takes a seed"):
        env.reset(options={"surface": 1})
    after = env.step(SLOW)[0]
    env.reset(seed=1)
    np.testing.assert_array_equal(after, env.step(SLOW)[0])


def test_step_outside_an_episode_and_render_before_one_are_refused_in_a_sentence() -> None:
    env = ScanLineEnv(lines=1, vary=surface, render_mode="rgb_array")
    with pytest.raises(ResetNeeded, match="call reset first"):
        env.step(MIDDLE)
    with pytest.raises(ResetNeeded, match="call reset first"):
        env.render()
    env.reset(seed=1)
    before = env.render()
    assert env.step(SLOW)[2:4] == (False, True)
    assert not np.array_equal(before, env.render())
    with pytest.raises(ResetNeeded, match="call reset first"):
        env.step(MIDDLE)
    with pytest.raises(ParameterError, match="render_mode = human is not allowed"):
        ScanLineEnv(render_mode="human")
