"""Claims about what makes a score doubtful."""

import numpy as np
import pytest

from afm_model import (
    ControllerParameters,
    Instrument,
    InstrumentParameters,
    ScoreSummary,
    SimParameters,
    build,
    simulate,
)
from afm_model.instrument.validity import doubts, load_gain
from afm_model.plant.steps import resolved_load

from ..session import NORMAL, PERIOD, X0

OPEN_LOOP = {"reference.z_r": 1e-9, "run.duration": 2.0 * PERIOD, "score.start": PERIOD, "plant.control_period": 1e-6}
CLOSED = {"run.duration": 0.625 * PERIOD, "score.start": PERIOD / 8.0, "plant.control_period": 1e-6}
PAPER = {"plant.kind": "paper"}
OPEN, TANH = {"law.kind": "open_loop"}, {"law.kind": "tanh"}


def told(values: dict[str, object], law: dict[str, object]) -> tuple[list[str], ScoreSummary]:
    """Doubts of a run, and its score."""
    sim, controller = build(SimParameters, values), build(ControllerParameters, law)
    score = simulate(sim, controller).score
    return doubts(sim, score, controller), score


@pytest.mark.parametrize(
    ("values", "law"),
    [
        (OPEN_LOOP, OPEN),
        (OPEN_LOOP | PAPER, OPEN),
        (OPEN_LOOP | PAPER | {"plant.z": "held"}, OPEN),
        (OPEN_LOOP | {"cantilever.a": 0.8e-7}, OPEN),
        (CLOSED, TANH),
        (CLOSED | PAPER | {"plant.z": "uniform"}, TANH | {"law.z_rate": "tip"}),
        (CLOSED | PAPER | {"plant.z": "uniform"}, OPEN),
    ],
)
def test_runs_in_which_everything_holds_leave_no_doubt(values, law):
    assert told(values, law)[0] == []


def test_where_nothing_was_scored_there_is_nothing_to_doubt():
    for values in ({}, PAPER):
        scope = Instrument(build(InstrumentParameters, values))
        assert doubts(scope.parameters, scope.score()) == []


class Ramp:
    """Moves the scanner by the same at every tick [V]."""

    def __init__(self, step: float) -> None:
        self.step, self.voltage = step, 0.0

    def answer(self, measurement: np.ndarray) -> np.ndarray:
        self.voltage += self.step
        return np.array([self.voltage, 0.0, 0.0])


def slid(step: float) -> tuple[list[str], ScoreSummary]:
    """The same of a warm tip that slides at 2 um/s."""
    values = {"plant.kind": "lever", "sample.kind": "flat", "plant.scanner": "stack_13um", "plant.tilt": 0.0}
    values |= {"plant.temperature": 295.0, "reference.z_r": 50e-9, "onboard.kind": "pi", "plant.dt": step}
    values |= {"plant.control_period": 1e-6, "run.duration": 6e-3, "score.start": 2e-3}
    sim = build(SimParameters, values)
    run = simulate(sim, Ramp(2e-12 / sim.piezo.sensitivity_x))
    return run.doubts, run.score


def switched(step: float) -> tuple[list[str], ScoreSummary]:
    """The same of a closed loop whose law switches at every tick."""
    return told(CLOSED | {"plant.dt": step}, {"law.kind": "sgn"})


@pytest.mark.parametrize(("run", "short", "resolved"), [(switched, 2e-7, False), (slid, 5e-8, True)])
def test_rests_as_short_as_a_step_are_told_and_a_score_that_they_make_moves_with_the_step(run, short, resolved):
    (sentence,), score = run(1e-6)
    assert f"the tip came to rest {score.stick_phases} times, for " in sentence
    assert "on average: rests begin and end with a step" in sentence
    others, other = run(short)
    assert other.stick_fraction != pytest.approx(score.stick_fraction, rel=0.5)
    # Rests of a warm tip take some microseconds, those under a law that switches never more than a step.
    assert (others == []) == resolved


def test_load_for_which_the_step_is_too_long_is_told_with_both_numbers():
    values = {"plant.dt": 2e-6, "detector.sample_period": 2e-6, "run.duration": 0.01, "score.start": 0.0}
    sim = build(SimParameters, values)

    class Raised:
        def answer(self, measurement: np.ndarray) -> np.ndarray:
            return np.array([0.0, 0.0, 5.0])

    score = simulate(sim, Raised()).score
    assert score.normal_force[1] > 2e-7 > resolved_load(sim)
    (sentence,) = doubts(sim, score)
    assert f"rose to {score.normal_force[1]:.3g} N: steps of plant.dt = 2e-06 s" in sentence
    assert "up to 5.29e-08 N only" in sentence
    # At the default step the same motion is resolved.
    sim = build(SimParameters, values | {"plant.dt": 1e-6})
    assert doubts(sim, simulate(sim, Raised()).score) == []


def test_paper_plant_beyond_pull_off_is_told_with_both_numbers():
    (sentence,), score = told(OPEN_LOOP | PAPER | {"cantilever.a": 0.9e-7}, OPEN)
    assert score.contact_fraction == 1.0  # it says so itself, whatever the load
    assert score.normal_force[0] / NORMAL == pytest.approx(-2.81, abs=0.01)
    # 152.3 nN on a flat sample, 1.25 % less on its tops.
    assert "the normal force fell to -1.688e-07 N, beyond the pull-off force of -1.504e-07 N" in sentence


def test_loop_through_friction_and_load_is_told_where_its_gain_reaches_one():
    steep = CLOSED | PAPER | {"sample.beta": 1.25e-7}
    (sentence,), coarse = told(steep, TANH)
    assert "gain of 1.05 at a normal force of -6.18e-09 N, which must be < 1" in sentence
    # Nothing else in the score shows it, but with a finer step it is another motion.
    _, fine = told(steep | {"plant.dt": 1e-7}, TANH)
    assert coarse.stick_phases == 1
    assert fine.stick_phases > 100


def test_gain_of_the_loop_is_that_of_condition_43():
    paper = build(InstrumentParameters, PAPER)
    reach = 85.0 * X0, 123.0 * X0
    # df/dN beta k / (1 + 1/mu) of (13), at the load at which the open loop comes closest to pull-off.
    assert load_gain(paper, -0.179 * NORMAL, *reach) == pytest.approx(0.106, abs=5e-4)  # digits given
    assert load_gain(paper, 0.0, *reach) == pytest.approx(
        5.04 * (4.0 / 3.0) * 2.0 ** (1.0 / 3.0) / (2.0 * 2.5384) * 0.0625 / 1.01, rel=1e-3
    )
    assert load_gain(build(InstrumentParameters, PAPER | {"sample.beta": 0.0}), 0.0, *reach) == 0.0


def test_drawn_f_z_with_the_rate_of_the_sample_is_told():
    drawn = CLOSED | PAPER | {"plant.z": "uniform"}
    (sentence,), sample = told(drawn, TANH | {"law.z_rate": "sample"})
    assert "law.z_rate = tip" in sentence
    _, tip = told(drawn, TANH | {"law.z_rate": "tip"})
    assert sample.rms[2] > 4.0 * tip.rms[2]
