"""Instruments as an environment of gymnasium, to learn laws: a drive is the action, a measurement is observed.

Needs gymnasium: `pip install './afm_model[learn]'`. Its `make` and `make_vec` import this module and make the
environments by the name "afm_model.studies.learning:afm_model/Tracking-v0", or ScanLine-v0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from types import SimpleNamespace
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ..compiled.lanes import LANES
from ..compiled.records import place
from ..core.errors import ParameterError
from ..instrument import Instrument
from ..instrument.controller import external_law
from ..lanes.loop import LEAST, Together, composition
from ..parameters import SimParameters, Value, changed
from ..parameters.scenario import Scenario, load_scenario
from ..parts.signals import Measurement
from ..run.engine import Engine
from ..run.pacing import Compiled
from ..run.simulated import ticks_to_simulate
from ..run.state import OVER
from .episode import checked, refuse_options, require_render_mode
from .episode_picture import EpisodePicture

_Array = NDArray[np.float64]
OBSERVED = {"position": 1e9, "velocity": 1e6, "deflection": 1e9, "deflection_rate": 1e6, "lateral_force": 1e9} | {
    **{"reference_position": 1e9, "reference_velocity": 1e6, "reference_acceleration": 1e3, "drive": 1.0}
}
"""Fields of a measurement in the order of an observation, in nm, nm/ms, nm/ms^2, nN, V: the factor from SI units."""
_COUNTS = {name: int(np.prod(Measurement.fields[name][1], dtype=int)) for name in OBSERVED}
_COLUMNS = np.concatenate([place(Measurement, name) + np.arange(count) for name, count in _COUNTS.items()])
_FACTORS = np.repeat(list(OBSERVED.values()), list(_COUNTS.values()))
OBSERVATION = [f"{name}_{'xyz'[i]}" if n == 3 else name for name, n in _COUNTS.items() for i in range(n)]
"""Names of the numbers of an observation."""
LARGEST = 1e9
"""Of an observation: 1 m, 1e3 m/s, 1 N. What is larger, of a motion that has diverged, is observed as this."""
ID, SCAN_ID = "afm_model/Tracking-v0", "afm_model/ScanLine-v0"
"""Registered names of the environments here, and of that of `scan_line`."""
_SCENARIO = "closed_loop_predictive"


def _observed(measurements: _Array) -> _Array:
    # A motion that has diverged may have no number.
    return np.clip(np.nan_to_num(measurements[:, _COLUMNS] * _FACTORS), -LARGEST, LARGEST)


def rewards(measurements: NDArray[Any], worst: float) -> _Array:
    """Of measurements: minus the distance of x and y from their reference over `worst` [m], -1 at the least."""
    error = (measurements["position"] - measurements["reference_position"])[..., :2]
    return -np.minimum(np.hypot(error[..., 0], error[..., 1]) / worst, 1.0)


# Stands where a law does: the drive is commanded already.
_GIVEN: Any = SimpleNamespace(block=external_law(), reset=lambda: None, raise_errors=lambda: None)


class TrackingVectorEnv(VectorEnv):  # type: ignore[misc]
    """Many instruments at once, each to follow the reference of a scenario.

    Each episode is a run of the scenario with other random numbers. It is truncated at its end, and terminated when
    the motion diverges; the next step starts a new one, whatever its action is (`AutoresetMode.NEXT_STEP`).

    - Action: drive of x, y, z over `drive_range`, -1 to 1, from now on. One outside is refused
      (`gymnasium.wrappers.vector.ClipAction` clips).
    - Observation: OBSERVATION, what a controller is given; nothing of the true state.
    - Reward: `rewards` at the end of the action; where the motion diverges, -1 for each action that was left.
    - Info: at a start `seed`, the random numbers are those of `plant.seed`; at an end `trajectory_sha256`, and `error`
      if it diverged. `simulate` with this seed and the same drives gives the same hash, if `drive_range` is a power of
      two.

    Parameters
    ----------
    scenario : Scenario or str
        Or its name; its law does not count.
    num_envs, hold : int
        Instruments; control ticks of an action.
    drive_range, worst : float
        [V]; error from which on the reward is -1 [m].
    vary : callable, optional
        Makes parameters of the simulator for an episode, such as {"contact.tau": 1.1e9}, with the random generator that
        it is given: no other control period, duration, step, plant or sample.

    Raises
    ------
    ParameterError
        If a parameter is not allowed, the run is endless, or `options` are given to a reset.
    ValueError
        If an action is outside -1 to 1, or is not a number.
    gymnasium.error.ResetNeeded
        If `step` is called before `reset`.
    """

    metadata: ClassVar[dict[str, Any]] = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}

    def __init__(
        self,
        scenario: Scenario | str = _SCENARIO,
        num_envs: int = LANES,
        *,
        drive_range: float = 4.0,
        worst: float = 5e-9,
        hold: int = 1,
        vary: Callable[[np.random.Generator], Mapping[str, Value]] | None = None,
    ) -> None:
        sim = (load_scenario(scenario) if isinstance(scenario, str) else scenario).sim
        self.num_envs, self._sim, self._total = num_envs, sim, ticks_to_simulate(sim)
        self._range, self._worst, self._hold, self._vary = drive_range, worst, hold, vary
        self.single_observation_space = Box(-LARGEST, LARGEST, (len(OBSERVATION),), np.float64)
        # Of float32, as learners expect; drives of float64 are put in force as they are.
        self.single_action_space = Box(-1.0, 1.0, (3,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        # Each its own, so that an episode does not depend on how those of others have ended.
        self._random = [np.random.default_rng() for _ in range(num_envs)]
        self._kind = composition(Instrument(self._sim, 1))
        self._engines, self._blocks = list[Engine](), list[Together]()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[_Array, dict[str, Any]]:
        """Start an episode in each instrument; with a seed all that follows is the same again."""
        super().reset(seed=seed)
        refuse_options(options)
        if seed is not None:
            self._random = [np.random.default_rng(seed + number) for number in range(self.num_envs)]
        infos: dict[str, Any] = {}
        self._engines = [self._start(number, infos) for number in range(self.num_envs)]
        instruments = [engine.instrument for engine in self._engines]
        firsts = range(0, self.num_envs, LANES) if self._kind is not None and self.num_envs >= LEAST else ()
        self._blocks = [Together(instruments[first : first + LANES], [_GIVEN] * LANES) for first in firsts]
        return _observed(self._measurements()), infos

    def step(self, actions: Any) -> tuple[_Array, _Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Put a drive in force in each instrument."""
        if not self.begun:
            raise ResetNeeded("step is not allowed before the first episode has started: call reset first")
        what = f"drives up to {self._range:g} V (drive_range)"
        drives = self._range * checked(actions, (self.num_envs, 3), what)
        infos: dict[str, Any] = {}
        over = np.array([engine.state in OVER for engine in self._engines])
        for number, engine in enumerate(self._engines):
            if over[number]:
                self._engines[number] = started = self._start(number, infos)
                if self._blocks:
                    self._blocks[number // LANES].exchange(number % LANES, started.instrument)
            else:
                command = engine.instrument.record("commanded")
                command.sequence, command.voltage[:] = engine.instrument.ticks, drives[number]
        self._advance(np.flatnonzero(~over).tolist())
        numbers = self._measurements()
        reward = np.where(over, 0.0, rewards(numbers.view(Measurement)[:, 0], self._worst))
        terminated = np.array([engine.error is not None for engine in self._engines])
        truncated = np.array([engine.state in OVER for engine in self._engines]) & ~terminated
        for number in np.flatnonzero(terminated | truncated).tolist():
            engine = self._engines[number]
            told = {"trajectory_sha256": engine.instrument.trajectory_sha256()}
            if engine.error is not None:
                told["error"] = str(engine.error)
                reward[number] = -1.0 + (engine.instrument.ticks - self._total) // self._hold
            infos = self._add_info(infos, told, number)
        return _observed(numbers), reward, terminated, truncated, infos

    def _start(self, number: int, infos: dict[str, Any]) -> Engine:
        random = self._random[number]
        seed = int(random.integers(2**31))
        sim = changed(self._sim, {**(self._vary(random) if self._vary is not None else {}), "plant.seed": seed})
        self._add_info(infos, {"seed": seed}, number)
        engine = Engine(sim, lambda engine: Compiled(engine, _GIVEN), self._total)
        engine.step()
        if composition(engine.instrument) != self._kind or sim.total_ticks != self._total:
            raise ParameterError("vary must not change control period, duration, step, plant or sample")
        return engine

    def _advance(self, running: list[int]) -> None:
        """Hold the drives for an action, or to the end of the run."""
        engines, instruments = self._engines, [engine.instrument for engine in self._engines]
        ends = {i: min(instruments[i].ticks + self._hold, self._total) for i in running}
        while ends:
            for first in range(0, self.num_envs, LANES):
                some = [i for i in ends if first <= i < first + LANES]
                ticks = [min(ends[i] - instruments[i].ticks, engines[i].wanted) for i in some]
                if self._blocks and some:
                    outcomes = self._blocks[first // LANES].close_loop([i - first for i in some], ticks)
                    made = [partial(instruments[i].ended, _GIVEN, each) for i, each in zip(some, outcomes, strict=True)]
                else:
                    made = [partial(instruments[i].close_loop, _GIVEN, n) for i, n in zip(some, ticks, strict=True)]
                for i, each in zip(some, made, strict=True):
                    engines[i].step(each)
            ends = {i: end for i, end in ends.items() if engines[i].state not in OVER and instruments[i].ticks < end}

    @property
    def sim(self) -> SimParameters:
        """Parameters that all instruments have in common."""
        return self._sim

    @property
    def begun(self) -> bool:
        """Whether `reset` has been called."""
        return bool(self._engines)

    def newest(self, number: int) -> tuple[float, _Array]:
        """Simulated time [s] and measurement of an instrument now."""
        instrument = self._engines[number].instrument
        return instrument.time, instrument.measurement

    def _measurements(self) -> _Array:
        return np.array([engine.instrument.measurement for engine in self._engines])


class TrackingEnv(gymnasium.Env[Any, Any]):  # type: ignore[misc]
    """One instrument as a plain `gymnasium.Env`; all else as `TrackingVectorEnv`, whose parameters it takes.

    An episode that is over stays over: `step` is then refused until `reset`.

    Parameters
    ----------
    scenario : Scenario or str
    render_mode : str, optional
        "rgb_array": `render` draws the episode up to now, (570, 720, 3).
    **parameters
        Of `TrackingVectorEnv`.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self, scenario: Scenario | str = _SCENARIO, *, render_mode: str | None = None, **parameters: Any
    ) -> None:
        require_render_mode(self, render_mode)
        self._one = TrackingVectorEnv(scenario, 1, **parameters)
        self.observation_space = self._one.single_observation_space
        self.action_space = self._one.single_action_space
        self.render_mode = render_mode
        self._picture = EpisodePicture(self._one.sim) if render_mode else None
        self._over = False

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, ...]:
        """Start an episode."""
        super().reset(seed=seed)
        found = _of_one(*self._one.reset(seed=seed, options=options))
        self._over = False
        if self._picture is not None:
            self._picture.begin()
            self._picture.add(*self._one.newest(0))
        return found

    def step(self, action: Any) -> tuple[Any, ...]:
        """Put a drive in force."""
        if self._over:
            raise ResetNeeded("step is not allowed after the end of an episode: call reset first")
        found = _of_one(*self._one.step(action))
        self._over = found[2] or found[3]
        if self._picture is not None:
            self._picture.add(*self._one.newest(0))
        return found

    def render(self) -> Any:
        """Draw the episode up to now; None without a render_mode."""
        if self._picture is None:
            return None
        if not self._one.begun:
            raise ResetNeeded("render is not allowed before the first episode has started: call reset first")
        return self._picture.pixels()


def _of_one(*arrays: Any) -> tuple[Any, ...]:
    *values, infos = arrays
    info = {name: each[0] for name, each in infos.items() if not name.startswith("_")}
    return (*(each[0] if each[0].ndim else each[0].item() for each in values), info)


if ID not in gymnasium.registry:
    gymnasium.register(ID, entry_point=TrackingEnv, vector_entry_point=TrackingVectorEnv)
    gymnasium.register(SCAN_ID, entry_point="afm_model.studies.scan_line:ScanLineEnv")
