"""The environment of a scan, to learn its settings: an action are gains, setpoint and speed of the next line.

Registered by `afm_model.studies.learning`, as "afm_model/ScanLine-v0".
"""

import warnings
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from numpy.typing import NDArray

from ..compiled.records import numbers_at, record_at, size
from ..core.errors import DivergenceError
from ..microscope import Approach, Local, Scan
from ..microscope.image import DIRECTIONS
from ..parameters import ControllerParameters, SimParameters, Value, changed
from ..parameters.scenario import changed_instrument, load_scenario
from ..parts.header import BlockHeader
from ..parts.signals import Surface
from .episode import checked, refuse_options, require_render_mode
from .episode_picture import line_pixels

_Array = NDArray[np.float64]
SETTINGS = {
    "integral_gain": (1e-6, 20e-6),  # of the z loop [m/(V s)]
    "proportional_gain": (5e-12, 500e-12),  # [m/V]
    "setpoint_force": (1e-9, 20e-9),  # [N]
    "line_rate": (4.0, 40.0),  # lines a second
}
"""What an action sets, and its value at -1 and at 1; in between by its logarithm."""
OBSERVED = {"error": 1e-9, "largest_error": 1e-9, "ringing": 1e-9, "difference": 1e-9, "roughness": 1e-9, "force": 1e-8}
"""What is observed of a line, and its value at 0 [m, N]; it is observed as its logarithm, 1 is 1000 times as much."""
OBSERVATION = [*OBSERVED, *SETTINGS, "done"]
"""Names of the numbers of an observation."""
COSTS = (1e-9, 20e-9, 0.1)
"""Height error [m], force [N], time [s] that cost 1 each."""
WORST = 10.0
"""Largest cost of a line."""
_FINE = 5
"""Samples of the virtual ADC in one value from which the error is judged."""
_LOG = np.log(np.array(list(SETTINGS.values())))
_TRUE = ("truth/place_x", "truth/place_y", "truth/normal_force")
_OVERSCAN = 0.5
_INSTRUMENT: dict[str, Value] = {
    # One mode of the cantilever and longer steps: the same errors to five digits, in 0.4 of the time.
    **{"plant.modes": 1, "plant.dt": 2.5e-6, "plant.gap": 20e-9, "plant.pair": "si_graphite", "detector.noise": 1e-3},
    **{"sample.kind": "rough", "sample.size": 1e-6, "sample.pixels": 128, "sample.shortest": 40e-9},
    "detector.channels": ", ".join(_TRUE),
}


def surfaces(random: np.random.Generator) -> dict[str, Value]:
    """Draw a rough surface, 0.5 to 15 nm rms, and the quality factor of the scanner along z, 10 to 40."""
    return {
        "sample.surface_seed": int(random.integers(2**31)),
        "sample.rms": float(np.exp(random.uniform(np.log(0.5e-9), np.log(15e-9)))),
        "sample.correlation": float(random.uniform(60e-9, 150e-9)),
        "plant.Q_scanner": float(np.exp(random.uniform(np.log(10.0), np.log(40.0)))),
    }


class ScannedLine(NamedTuple):
    """A line, trace and retrace, (2, pixels), and what it has cost."""

    x: _Array  # from the centre of the line (pixels,) [m]
    height: _Array  # [m]
    true_height: _Array  # of the sample, with the mean of `height` [m]
    error: _Array  # deflection less setpoint, trace and then retrace, finer than pixels [m]
    force_seen: _Array  # as the deflection shows it, at the same places [N]
    force: _Array  # the true normal force [N]
    time: float  # [s]

    @property
    def costs(self) -> _Array:
        """Of height error (rms), largest force, time."""
        wrong = np.sqrt(np.mean((self.height - self.true_height) ** 2))
        return np.array([wrong, np.abs(self.force).max(), self.time]) / COSTS

    @property
    def seen(self) -> _Array:
        """Of OBSERVED, in their order."""
        error, (trace, retrace) = self.error, self.height
        spread = [each.std() for each in (error, np.diff(error), trace - retrace, trace)]
        return np.array([spread[0], np.abs(error).max(), *spread[1:], np.abs(self.force_seen).max()])


class ScanLineEnv(gymnasium.Env[Any, Any]):  # type: ignore[misc]
    """A microscope that scans lines of a surface, one next to the other.

    An episode is a surface. It begins with a line at the middle of SETTINGS, and is truncated after `lines` more; it
    is terminated if the motion diverges.

    - Action: SETTINGS of the next line, -1 to 1. One outside is refused (`gymnasium.wrappers.ClipAction` clips).
    - Observation: OBSERVATION, -1 to 1, what an operator sees of the last line: rms and largest error of the z loop,
      its ringing, difference of trace and retrace, height, largest force as the deflection shows it; then the settings
      of this line, and the part of the lines that is done. Nothing of the true state.
    - Reward: minus the sum of true height error (rms, without the mean), largest true force and time, over COSTS, and
      -WORST at the least. Where the motion diverges, -WORST for each line that was left.
    - Info: `costs`, the three parts; at a start `parameters`, those of `vary`, and `seed`, that of the noise.

    Parameters
    ----------
    lines, pixels : int
        Lines of an episode; pixels of a line.
    length : float
        Of a line [m].
    vary : callable, optional
        Makes parameters of the simulator for an episode with the random generator that it is given, as `surfaces`. The
        others are those of the scenario two_materials with a tip on graphite.
    render_mode : str, optional
        "rgb_array": `render` draws the last line, (570, 720, 3).

    Raises
    ------
    ParameterError
        If a parameter is not allowed, or `options` are given.
    ValueError
        If an action is outside -1 to 1, or is not a number.
    gymnasium.error.ResetNeeded
        If `step` is called before `reset`, or after the end of an episode.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        *,
        lines: int = 16,
        pixels: int = 50,
        length: float = 300e-9,
        vary: Callable[[np.random.Generator], Mapping[str, Value]] = surfaces,
        render_mode: str | None = None,
    ) -> None:
        require_render_mode(self, render_mode)
        scenario = load_scenario("two_materials")
        self._sim, self._law = changed_instrument(scenario, _INSTRUMENT), scenario.controller
        self._lines, self._pixels, self._length, self._vary = lines, pixels, length, vary
        self.render_mode = render_mode
        self.action_space = Box(-1.0, 1.0, (len(SETTINGS),), np.float32)
        self.observation_space = Box(-1.0, 1.0, (len(OBSERVATION),), np.float32)
        self._random = np.random.default_rng()
        self._bench: _Bench | None = None
        self._done = 0
        self.last: ScannedLine | None = None
        """The last line."""

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Approach another surface, and scan a first line."""
        super().reset(seed=seed)
        refuse_options(options)
        if seed is not None:
            self._random = np.random.default_rng(seed)
        varied = dict(self._vary(self._random))
        sim = changed(self._sim, {**varied, "plant.seed": int(self._random.integers(2**31))})
        self._bench, self._done = _Bench(sim, self._law), 0
        seen, costs = self._scan(np.zeros(len(SETTINGS)))
        return seen, {"parameters": varied, "seed": sim.plant.seed, "costs": costs}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Scan the next line with these settings."""
        if self._bench is None:
            raise ResetNeeded("step is not allowed before the start of an episode, or after its end: call reset first")
        given = checked(action, (len(SETTINGS),), "settings from the least to the largest of SETTINGS")
        self._done += 1
        over, wrong = self._done == self._lines, ""
        info: dict[str, Any]
        try:
            seen, costs = self._scan(given)
            reward, info = -min(float(costs.sum()), WORST), {"costs": costs}
        except DivergenceError as error:
            wrong, reward = str(error), -WORST * (self._lines - self._done + 1)
            seen, info = np.ones(len(OBSERVATION), np.float32), {"error": wrong}
        if over or wrong:
            self._bench = None
        return seen, reward, bool(wrong), over and not wrong, info

    def render(self) -> Any:
        """Draw the last line; None without a render_mode."""
        if self.render_mode is None:
            return None
        if self.last is None:
            raise ResetNeeded("render is not allowed before the first episode has started: call reset first")
        return line_pixels(self.last)

    def _scan(self, action: _Array) -> tuple[Any, _Array]:
        assert self._bench is not None
        settings = np.exp(_LOG[:, 0] + 0.5 * (action + 1.0) * (_LOG[:, 1] - _LOG[:, 0]))
        place = self._done * self._length / self._pixels
        self.last = line = self._bench.scan(
            dict(zip(SETTINGS, settings, strict=True)), place, self._length, self._pixels
        )
        seen = np.log10(np.maximum(line.seen, 1e-30) / list(OBSERVED.values())) / 3.0
        numbers = np.concatenate([seen, action, [self._done / self._lines]])
        return np.clip(numbers, -1.0, 1.0).astype(np.float32), line.costs


class _Bench:
    """A microscope on a surface of which the true heights are known."""

    def __init__(self, sim: SimParameters, law: ControllerParameters) -> None:
        self._microscope = Local(sim, law)
        self._microscope.execute(Approach(rate=10e-6))
        instrument = self._microscope.instrument
        header = record_at(numbers_at(instrument.address, size(BlockHeader)), 0, BlockHeader)
        self._sample, self._scales = instrument.part("sample"), sim.scales
        self._constants = instrument.record("sample_constants")
        self._map = numbers_at(instrument.address, header.plant_map)[header.sample_map :]
        self._surface = record_at(np.zeros(size(Surface)), 0, Surface)
        self._sample_period, self._metres = sim.detector.sample_period, sim.detector.deflection_sensitivity

    def scan(self, settings: dict[str, float], y: float, length: float, pixels: int) -> ScannedLine:
        """Scan a line at y [m] with these settings."""
        microscope, rate = self._microscope, settings.pop("line_rate")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that the loop oscillates with its gains is for the learner to find out
            microscope.set_loop(**settings)
        per = max(1, round(0.5 / (rate * (1.0 + _OVERSCAN) * pixels * _FINE * self._sample_period)))
        frame = {"centre_y": y, "size_x": length, "lines": 1, "slow_axis": False, "overscan": _OVERSCAN}
        begun = microscope.time
        found = microscope.execute(
            Scan(**frame, pixels=pixels * per, line_rate=rate, channels=", ".join(("height", "error", *_TRUE)))
        ).result
        height, error, x_true, y_true, force = (
            np.concatenate([found.data[name, way] for way in DIRECTIONS]) for name in ("height", "error", *_TRUE)
        )
        height, x_true, y_true = (each.reshape(2, pixels, per).mean(axis=2) for each in (height, x_true, y_true))
        true = np.array([self._height(*place) for place in zip(x_true.flat, y_true.flat, strict=True)]).reshape(2, -1)
        volts = microscope.state.setpoint
        return ScannedLine(
            (np.arange(pixels) + 0.5) * length / pixels - 0.5 * length,
            height,
            true - true.mean() + height.mean(),
            self._metres * error,
            settings["setpoint_force"] * (1.0 + error / volts),
            force,
            microscope.time - begun,
        )

    def _height(self, x: float, y: float) -> float:
        self._sample.surface(x / self._scales.x0, y / self._scales.x0, self._surface, self._constants, self._map)
        return float(self._surface.height * self._scales.z0)
