"""Claims about the steps that are allowed: results are right up to the longest, at the loads within reach."""

import math
from collections.abc import Mapping

import numpy as np
import pytest

from afm_model import (
    ControllerParameters,
    InstrumentParameters,
    ParameterError,
    ScoreSummary,
    SimParameters,
    Simulation,
    build,
    simulate,
)
from afm_model.parts.signals import Measurement
from afm_model.plant.steps import ACCURATE, reachable_load, resolved_load, stable_step

from ..rests import CHANNELS, rests
from ..session import PERIOD, controller

OPEN_LOOP = {"reference.z_r": 1e-9, "run.duration": 2.0 * PERIOD, "score.start": PERIOD}
FINE = 2.5e-7
TICK = 24e-6
"""A control period of every step here [s]."""


def stepped(dt: float) -> dict[str, float]:
    """A step, with every one sampled."""
    return {"plant.dt": dt, "detector.sample_period": dt}


class Raised:
    """Open loop, with the sample raised by 100 nm after 4.8 ms."""

    def __init__(self) -> None:
        self._law, self._ticks, self._height = controller({"law.kind": "open_loop"}), 0, 0.0

    def answer(self, measurement: np.ndarray) -> np.ndarray:
        drive = np.array(self._law.answer(measurement))
        self._ticks += 1
        if self._ticks <= 200:
            self._height = drive[2]
        else:
            drive[2] = self._height + 5.0
        return drive


class Approach:
    """Raises the sample at 10 um/s, by 40 nm."""

    def __init__(self) -> None:
        self._ticks, self._start = 0, 0.0

    def answer(self, measurement: np.ndarray) -> np.ndarray:
        if self._ticks == 0:
            self._start = measurement.view(Measurement)[0].drive[2]
        self._ticks += 1
        return np.array([0.0, 0.0, self._start + min(self._ticks * TICK * 500.0, 2.0)])


def run(dt: float, values: Mapping[str, object], law: object) -> Simulation:
    """A run with ticks of TICK."""
    sim = build(SimParameters, {"plant.control_period": TICK, "detector.channels": CHANNELS} | values | stepped(dt))
    return simulate(sim, build(ControllerParameters, law) if isinstance(law, dict) else law)


def numbers(score: ScoreSummary) -> np.ndarray:
    """What is compared of a score."""
    return np.array([score.stick_fraction, *score.extent[:2], *score.friction, *score.normal_force])


def pressed(load: float) -> dict[str, object]:
    """Open loop under a load, with a drive that moves the scanner against the greater friction."""
    amplitude = 5e-9 * (1.0 + load / 3e-7)
    return OPEN_LOOP | {"cantilever.W": load, "reference.amplitude_x": amplitude, "reference.amplitude_y": amplitude}


OPEN = {"law.kind": "open_loop"}
RAISED = {"reference.z_r": 1e-9, "run.duration": 0.04, "score.start": 0.0024}


@pytest.mark.parametrize(
    ("values", "law", "dt"),
    [
        (OPEN_LOOP, OPEN, 2e-6),
        (pressed(6e-8), OPEN, TICK / 13.0),
        (pressed(3e-7), OPEN, 1.6e-6),
        (pressed(1e-6), OPEN, 1.2e-6),
        (RAISED, Raised, 2e-6),
        ({"run.duration": 0.625 * PERIOD, "score.start": PERIOD / 8.0}, {"law.alpha": 0.4}, 2e-6),
    ],
    ids=["setpoint", "60 nN", "300 nN", "1 uN", "raised by 100 nm", "tanh"],
)
def test_score_is_right_at_the_longest_steps_allowed(values, law, dt):
    coarse, fine = (run(each, values, law() if isinstance(law, type) else law) for each in (dt, FINE))
    a, b = numbers(coarse.score), numbers(fine.score)
    # Fractions and lengths of themselves, forces of their range.
    span = np.array([b[0], b[1], b[2], b[4], b[4], b[6] - b[5], b[6] - b[5]])
    assert (np.abs(a - b) < 6e-4 * span).all()
    durations = [[rest.duration for rest in rests(each)] for each in (coarse, fine)]
    # The same rests. They begin and end with a step, or at a tick where the held drive lets go in a jump.
    assert durations[0] == pytest.approx(durations[1], abs=TICK + dt)


def snap_in(dt: float) -> np.ndarray:
    """Least and largest normal force [N] of an approach, the mean over some distances at the start."""
    values = {"run.duration": 0.006, "score.start": 0.0}
    gaps = np.linspace(20e-9, 20.5e-9, 6)
    return np.mean([run(dt, values | {"plant.gap": gap}, Approach()).score.normal_force for gap in gaps], axis=0)


def test_forces_of_the_snap_into_contact_are_right_to_four_percent_at_the_longest_step():
    assert snap_in(2e-6) == pytest.approx(snap_in(FINE), rel=0.04)


def test_steps_that_give_nonsense_are_refused_with_the_limit_and_its_load():
    for dt in (2.1e-6, 8e-6, 8.4e-6):
        assert dt < stable_step(InstrumentParameters())  # stable at rest
        with pytest.raises(
            ParameterError,
            match=r"must be <= 2\.07e-06 s for the resonance of the contact under 1\.58e-08 N, the largest load",
        ):
            build(InstrumentParameters, stepped(dt) | {"plant.control_period": dt})
    build(InstrumentParameters, stepped(2e-6))


@pytest.mark.parametrize("load", [6e-8, 6e-7, 6e-6])
def test_limit_is_half_a_radian_of_the_resonance_of_the_loaded_contact(load):
    # Stiffness 18 u^2 (2 u^3 - 1) / (6 u^3 - 1) |L_s| R / a_0^2 at this load, u^3 = (1 + sqrt(1 + L)) / 2.
    flat = {"sample.beta": 0.0, "cantilever.W": load, "reference.z_r": 0.0}
    contact = InstrumentParameters().contact
    u3 = 0.5 * (1.0 + math.sqrt(1.0 + load / contact.pull_off_force))
    a_0 = (12.0 * math.pi * contact.R**2 * contact.gamma / contact.K) ** (1.0 / 3.0)
    ratio = 18.0 * u3 ** (2.0 / 3.0) * (2.0 * u3 - 1.0) / (6.0 * u3 - 1.0)
    stiffness = ratio * contact.pull_off_force * contact.R / a_0**2
    longest = ACCURATE / math.sqrt(stiffness / (6e-9 / 1.01) + (2.0 * math.pi * 2400.0) ** 2)
    build(InstrumentParameters, flat | stepped(0.999 * longest) | {"plant.control_period": 0.999 * longest})
    with pytest.raises(ParameterError, match=r"for the resonance of the contact under"):
        build(InstrumentParameters, flat | stepped(1.001 * longest) | {"plant.control_period": 1.001 * longest})


def test_range_of_the_drive_counts_as_a_load_within_reach():
    # 10 V are 200 nm of both springs in a row, under the sample's 12.5 nm.
    k_c, k_z = 6e-9 * (2.0 * math.pi * 2400.0) ** 2, 6e-7 * (2.0 * math.pi * 686.13) ** 2
    share = k_z / (k_c + k_z)
    limited = build(InstrumentParameters, {"piezo.limit": 10.0})
    assert reachable_load(limited) == pytest.approx(share * (k_c * 212.5e-9 + 0.6e-9), rel=1e-9)
    build(InstrumentParameters, stepped(2e-6))
    with pytest.raises(ParameterError, match=r"must be <= 1\.77e-06 s .* 2\.59e-07 N"):
        build(InstrumentParameters, stepped(2e-6) | {"piezo.limit": 10.0})


def test_full_drive_holds_the_tip_at_the_load_within_reach():
    values = {"sample.beta": 0.0, "piezo.limit": 5.0, "plant.control_period": 2e-6, "run.duration": 0.02}

    class Full:
        def answer(self, measurement: np.ndarray) -> np.ndarray:
            return np.array([0.0, 0.0, 5.0])

    sim = build(SimParameters, values)
    held = simulate(sim, Full()).channel("truth/normal_force")[-1]
    # The contact gives in by its indentation, some nanometres of a hundred, and the scanner still swings.
    assert 0.9 * reachable_load(sim) < held < 1.02 * reachable_load(sim)


@pytest.mark.parametrize("dt", [1e-6, 1.5e-6, 2e-6])
def test_resolved_load_is_the_one_at_which_the_step_becomes_too_long(dt):
    flat = stepped(dt) | {"plant.control_period": dt, "sample.beta": 0.0, "reference.z_r": 0.0, "cantilever.W": 0.0}
    resolved = resolved_load(build(InstrumentParameters, flat))
    build(InstrumentParameters, flat | {"cantilever.W": 0.999 * resolved})
    with pytest.raises(ParameterError, match=r"plant\.dt"):
        build(InstrumentParameters, flat | {"cantilever.W": 1.001 * resolved})


def test_resolved_load_of_the_paper_plant_knows_no_bound():
    assert resolved_load(build(InstrumentParameters, {"plant.kind": "paper"})) == math.inf


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"scanner.f_x": 4e5}, "for the faster lateral resonance of the scanner, 4e.05 Hz"),
        ({"scanner.f_z": 4e5}, "for the resonance of the contact under"),
        ({"plant.kind": "paper", "scanner.f_y": 4e5}, "for the faster lateral resonance of the scanner, 4e.05 Hz"),
        ({"plant.kind": "paper", "cantilever.f_c": 4e6}, "vertical resonance of scanner and cantilever"),
        ({"plant.kind": "paper", "plant.control_period": 2.4e-5} | stepped(2.4e-5), r"must be <= 2\.38e-05 s"),
    ],
)
def test_step_that_cannot_resolve_scanner_or_cantilever_is_refused(values, words):
    with pytest.raises(ParameterError, match=words):
        build(InstrumentParameters, values)


@pytest.mark.parametrize(("z", "number"), [("held", 22), ("computed", 16)])
def test_paper_plant_rests_as_often_at_its_longest_step(z, number):
    values = OPEN_LOOP | {"plant.kind": "paper", "plant.z": z, "plant.control_period": 4.6e-5}
    coarse, fine = (run(dt, values, OPEN) for dt in (2.3e-5, 5e-7))
    assert len(rests(coarse)) == len(rests(fine)) == number
    assert coarse.score.stick_fraction == pytest.approx(fine.score.stick_fraction, abs=5e-3)
    assert coarse.score.extent[:2] == pytest.approx(fine.score.extent[:2], rel=1e-3)
