"""Make the table of wrong models: what a law does when it is configured for another microscope than the true one."""

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from ..core.registry import names
from ..parameters import ControllerParameters, SimParameters, Value, build, changed, flatten
from ..parameters.scenario import law_timing
from ..run.simulation import Simulation, simulate
from .contender import NOISE, Contender, feedback_of
from .trial import FAILURES
from .unranked import unranked

_OMEGA = 50.0
_AMPLITUDE = 5e-9
SEEDS = 5
"""Runs of a case in which something is drawn."""
LOST = 99.0
"""Error [% of the amplitude] from which on a law has lost the reference: a scanner that stands still has 99.9."""


class Rate(NamedTuple):
    """How often the law is asked, and how late its drives are."""

    title: str
    period: float  # [s]
    delay_ticks: int
    packet: int = 1  # drives in an answer, for a law that has `law.packet`
    stir: float = 0.0  # noise of the position sensors [m]: where the last bit decides, a case is several runs


RATES = (Rate("50 us + 1", 5e-5, 1), Rate("200 us + 1", 2e-4, 1), Rate("1 ms packets", 1e-3, 1, 20, 1e-17))
"""Between two measurements 1 ms apart the motion magnifies what the first ones differ by."""


class Case(NamedTuple):
    """One wrong model."""

    title: str
    true: Mapping[str, Value] = {}  # parameters of the instrument
    told: Mapping[str, float] = {}  # what the controller is told, over what is true, by parameter
    ticks: int = 0  # of delay that the law is told, less those of the plant
    own: Mapping[str, Value] = {}  # parameters of the law, where it has them
    periods: int = 3  # of the reference; the last one is scored


def _all_axes(name: str, factor: float) -> dict[str, float]:
    return {name.format(axis): factor for axis in "xyz"}


def _ceramic(hysteresis: float, creep: float = 0.0) -> dict[str, Value]:
    opened: dict[str, Value] = {f"piezo.hysteresis_{axis}": hysteresis for axis in "xy"}
    return {"piezo.kind": "ceramic", **opened, "piezo.creep": creep}


def _sine(amplitude: float = 1.0, speed: float = 1.0, **more: Value) -> dict[str, Value]:
    both: dict[str, Value] = {f"reference.amplitude_{axis}": amplitude * _AMPLITUDE for axis in "xy"}
    both |= {f"reference.omega_{axis}": speed * _OMEGA for axis in "xy"}
    return both | {f"reference.{name}": value for name, value in more.items()}


_TAU = 0.91e9
CASES = (
    Case("the truth"),
    *(Case(f"resonances {100 * (f - 1):+.0f} %", {}, _all_axes("scanner.f_{}", f)) for f in (0.95, 0.98, 1.02, 1.05)),
    Case("resonance of x +2 %", {}, {"scanner.f_x": 1.02}),
    Case("damping x 2", {}, _all_axes("scanner.xi_{}", 2.0)),
    Case("mass ratio +10 %", {}, {"scanner.mass_ratio": 1.1}),
    Case("mass ratio -10 %", {}, {"scanner.mass_ratio": 0.9}),
    Case("sensitivity of the piezo +5 %", {}, _all_axes("piezo.sensitivity_{}", 1.05)),
    Case("sensitivity of the piezo -5 %", {}, _all_axes("piezo.sensitivity_{}", 0.95)),
    *(Case(f"lateral gain {gain:g}", {"detector.lateral_gain": gain}) for gain in (0.9, 1.1)),
    Case("deflection gain 1.05", {"detector.deflection_gain": 1.05}),
    Case("crosstalk .02", {"detector.lateral_in_deflection": 0.02, "detector.deflection_in_lateral": 0.02}),
    *(Case(f"lateral zero + {n} nN", {"detector.lateral_offset": n / 50.0}) for n in (2, 20)),
    Case("z sensor + 50 nm", {"fault.z.kind": "offset", "fault.z.signal": "position_z", "fault.z.size": 50e-9}),
    *(Case(f"friction x {factor:g}", {"contact.tau": factor * _TAU}) for factor in (0.5, 0.6, 1.5, 2.0)),
    Case("patches x .9", {"sample.kind": "patches", "sample.width": 2e-9, "sample.strength": 0.9}),
    Case("height x 2", {"sample.beta": 25e-9}),
    Case("hysteresis .5 %", _ceramic(0.005)),
    Case("hysteresis 5 %, creep 1.5 %", _ceramic(0.05, 0.015)),
    Case("creep 1.5 %", _ceramic(0.0, 0.015)),
    Case("drift 1e-15 m/s", {"drift.rate_x": 1e-15, "drift.rate_y": 1e-15}),
    Case("drift 1 nm/s", {"drift.rate_x": 1e-9, "drift.rate_y": 1e-9}),
    Case("position noise 1e-18 m", {"detector.position_noise": 1e-18}),
    Case("noise", {**NOISE, "detector.adc_bits": 16}),
    Case("DAC of 16 bits", {"piezo.limit": 10.0, "piezo.dac_bits": 16}),
    Case("a tick of delay too few", ticks=-1),
    Case("a tick of delay too many", ticks=1),
    Case("triangle", _sine(shape_x="triangle", shape_y="triangle")),
    Case(
        "triangle, corners given",
        _sine(shape_x="triangle", shape_y="triangle"),
        own={"law.corner_x": _AMPLITUDE, "law.corner_y": _AMPLITUDE},
    ),
    Case("amplitude x 3", _sine(3.0)),
    Case("amplitude x 5", _sine(5.0)),
    Case("frequency x 3", _sine(1.0, 3.0)),
    Case("frequency x 5", _sine(1.0, 5.0)),
    Case("Lissajous 2:3", _sine() | {"reference.omega_x": _OMEGA, "reference.omega_y": 1.5 * _OMEGA}),
    Case("along x alone", _sine(amplitude_y=0.0)),
    Case("along y alone", _sine(amplitude_x=0.0)),
)
"""Wrong models, and references other than the usual one."""
CASE = {case.title: case for case in CASES}


def mixed(seed: int) -> Case:
    """Return a case in which all that is configured is wrong together, each number by as much as in its row at most.

    In addition the radius of the tip (20 %) and the configured sample (height 10 %, wave numbers 3 %) are wrong. Every
    second draw has hysteresis and creep, every third crosstalk; the delay is wrong by a tick in two of five.

    Parameters
    ----------
    seed : int
        Of the draw; the same seed is the same case.
    """
    draw = np.random.default_rng(seed)

    def about_one(part: float) -> float:
        return 1.0 + part * draw.uniform(-1.0, 1.0)

    told = {f"{name}_{axis}": about_one(0.05) for name in ("scanner.f", "piezo.sensitivity") for axis in "xyz"}
    told |= {f"scanner.xi_{axis}": 2.0 ** draw.uniform(-1.0, 1.0) for axis in "xyz"}
    told |= {"scanner.mass_ratio": about_one(0.1), "contact.R": about_one(0.2), "sample.beta": about_one(0.1)}
    told |= {f"sample.k_{axis}": about_one(0.03) for axis in "xy"}
    true: dict[str, Value] = {
        "contact.tau": _TAU * 2.0 ** draw.uniform(-1.0, 1.0),
        "detector.lateral_gain": about_one(0.1),
        "detector.deflection_gain": about_one(0.05),
    }
    if draw.random() < 1.0 / 2.0:
        true |= {"piezo.kind": "ceramic", "piezo.creep": 0.015 * draw.random()}
        true |= {f"piezo.hysteresis_{axis}": 0.05 * draw.random() for axis in "xy"}
    if draw.random() < 1.0 / 3.0:
        crosstalk = ("detector.lateral_in_deflection", "detector.deflection_in_lateral")
        true |= {name: 0.02 * draw.uniform(-1.0, 1.0) for name in crosstalk}
    return Case(f"all wrong, draw {seed}", true, told, int(draw.choice((-1, 0, 0, 0, 1))))


def _true(case: Case, rate: Rate, noise: float) -> dict[str, Value]:
    """Parameters of the instrument in a case, with noise of a level."""
    drawn: dict[str, Value] = {"detector.position_noise": rate.stir} if rate.stir else {}
    if noise != 0.0:
        drawn = {"detector.adc_bits": 16, **{name: noise * value for name, value in NOISE.items()}}
    return drawn | dict(case.true)


def parameters_of(
    case: Case, rate: Rate, law: Contender, noise: float = 0.0, seed: int = 0
) -> tuple[SimParameters, ControllerParameters]:
    """Return the parameters of one run of a part, with noise of this level (`contender.NOISE`) in addition.

    A law of this package is given the wrong number. A user's law may have the right numbers in its code, whatever it is
    given: there the instrument is changed instead, the other way, as for an object.

    Raises
    ------
    ParameterError
        If the law refuses what it is given.
    """
    own = law.parameters
    has = flatten(build(ControllerParameters, {"law.kind": law.kind}))
    packets = "law.packet" in has
    if packets and rate.packet > 1:
        own |= {"law.packet": rate.packet, "law.spare": 1}
    own |= {name: value for name, value in case.own.items() if name in has}
    sim = _instrument(case, rate, noise, seed, packets)
    own |= feedback_of(law, noisy=sim.detector.noise != 0.0)
    timing = law_timing(own, sim)
    if law.kind not in names("law"):
        return _off(case, rate, sim), build(ControllerParameters, timing | own)
    if "law.delay_ticks" in timing:
        timing["law.delay_ticks"] = max(0, rate.delay_ticks + case.ticks)
    controller = build(ControllerParameters, timing | own)
    plain = flatten(controller)
    return sim, changed(controller, {name: float(plain[name]) * factor for name, factor in case.told.items()})


def instruments_of(case: Case, rate: Rate, noise: float = 0.0, seed: int = 0) -> tuple[SimParameters, SimParameters]:
    """Return the instrument of one run of an object or a node, and the instrument that it is given.

    Its law is its own, so what it is given stays as it is: the true instrument differs by as much the other way.
    """
    reference = {name: value for name, value in case.true.items() if name.startswith("reference.")}
    told = _instrument(Case(case.title, reference, periods=case.periods), rate._replace(stir=0.0))
    return _off(case, rate, _instrument(case, rate, noise, seed)), told


def _off(case: Case, rate: Rate, true: SimParameters) -> SimParameters:
    """Return the instrument of a case, changed by as much as a law of this package is given wrong, the other way."""
    plain = flatten(true)
    news: dict[str, Value] = {name: float(plain[name]) / by for name, by in case.told.items() if name in plain}
    return changed(true, news | {"plant.delay_ticks": max(0, rate.delay_ticks - case.ticks)})


def _instrument(case: Case, rate: Rate, noise: float = 0.0, seed: int = 0, packets: bool = True) -> SimParameters:
    """Return the true instrument at a rate, but for what is configured wrong; `packets`: it may get several drives."""
    cycle = 2.0 * math.pi / float(case.true.get("reference.omega_x", _OMEGA))
    if case.true.get("reference.omega_y", _OMEGA) != case.true.get("reference.omega_x", _OMEGA):
        cycle *= 2.0
    news: dict[str, Value] = {
        "plant.control_period": rate.period,
        "plant.delay_ticks": rate.delay_ticks,
        "run.duration": case.periods * cycle,
        "score.start": (case.periods - 1) * cycle,
    }
    if packets and rate.packet > 1:
        news["piezo.dac_period"] = rate.period / rate.packet
    return build(SimParameters, news | _true(case, rate, noise) | {"plant.seed": seed})


def seeds(case: Case, rate: Rate, noise: float = 0.0) -> int:
    """How often a case is run."""
    true = _true(case, rate, noise)
    return SEEDS if any(float(true.get(name, 0.0)) != 0.0 for name in NOISE) else 1


def run_case(case: Case, rate: Rate, law: Contender, noise: float = 0.0) -> dict[str, Any]:
    """Numbers of one case; where something is drawn of SEEDS runs.

    Returns
    -------
    dict
        `first`, `third`: largest error of x and y in the first period of the reference and in the last one, by default
        the third [% of the amplitude], the median of the runs; `worst`: the largest of `third`; `contact`: part of the
        time, the least; `load`: largest force on the tip [N]; `lost`: why the worst of the runs that are lost counts as
        that, "" if none is.
    """
    runs = [_run(case, rate, law, noise, seed) for seed in range(seeds(case, rate, noise))]
    lost = [run for run in runs if run["lost"]]
    return {
        "first": median(run["first"] for run in runs),
        "third": median(run["third"] for run in runs),
        "worst": max(run["third"] for run in runs),
        "contact": float(np.min([run["contact"] for run in runs])),
        "load": float(np.max([run["load"] for run in runs])),
        "lost": max(lost, key=lambda run: run["third"])["lost"] if lost else "",
    }


def _simulated(case: Case, rate: Rate, law: Contender, noise: float, seed: int) -> Simulation:
    """One run of a case."""
    if law.is_part:
        return simulate(*parameters_of(case, rate, law, noise, seed))
    sim, told = instruments_of(case, rate, noise, seed)
    with law.begin(told) as begun:
        return simulate(sim, begun)


def _run(case: Case, rate: Rate, law: Contender, noise: float, seed: int) -> dict[str, Any]:
    """What comes out of one run of a case."""
    row: dict[str, Any] = {"first": math.inf, "third": math.inf, "contact": math.nan, "load": math.nan}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = _simulated(case, rate, law, noise, seed)
    except FAILURES as error:
        return row | {"lost": str(error)}
    except (Exception, SystemExit) as error:
        # An object may raise anything; the other runs continue.
        if law.is_part:
            raise
        return row | {"lost": f"{type(error).__name__}: {error}"}
    score, size = result.score, max(abs(each) for each in result.parameters.reference.amplitude)
    off = np.abs(result.truth["position"][:, :2] - result.measurements["reference_position"][:, :2])
    row["first"] = 100.0 * float(np.max(off[result.time <= result.time[-1] / case.periods])) / size
    row["third"] = 100.0 * float(np.max(score.max[:2])) / size
    row["contact"] = score.contact_fraction
    row["load"] = max(abs(force) for force in score.normal_force)
    if not row["third"] < LOST:
        return row | {"lost": f"error {row['third']:.3g} %: no better than a scanner that stands still"}
    # Not `result.doubts`: a photodiode at the end of its range before the scored period makes no score doubtful.
    return row | {"lost": unranked(result.parameters, score)}


def wrong_models(
    law: Contender, rates: Sequence[Rate] = RATES, cases: Sequence[Case] = CASES, noise: float = 0.0
) -> Iterator[dict[str, Any]]:
    """Rows of a law, one by one as they are run: every case at every rate, see `run_case`."""
    for case in cases:
        for rate in rates:
            yield {"law": law.label, "case": case.title, "rate": rate.title, **run_case(case, rate, law, noise)}
