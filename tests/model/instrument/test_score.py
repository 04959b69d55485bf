"""Claims about the score, recomputed from the recorded blocks."""

import numpy as np
import pytest

from afm_model import ScoreSummary
from afm_model.instrument.score import row
from afm_model.parameters import InstrumentParameters

from .. import session


def test_score_is_that_of_the_recorded_run():
    # One step per tick, so that every step is recorded; the run sticks and slips and never loses contact.
    values = {
        "plant.control_period": 1e-6,
        "score.start": 1e-3,
        "reference.omega_x": 300.0,
        "reference.omega_y": 200.0,
        # A sample on which a tip at this speed stays.
        "sample.beta": 2e-9,
        "sample.k_x": 5e8,
        "sample.k_y": 5e8,
    }
    scope = session.instrument(values)
    y, u, samples = session.joined(session.run(scope, session.controller({"law.kind": "open_loop"}), 8e-3))
    first = 1000
    score = scope.score()
    assert score.ticks == len(y) - first
    # What a step did stands in the measurement after it.
    end = session.measured(scope)
    position = np.column_stack([y.position[:, :2], y.deflection])[first + 1 :]
    position = np.vstack([position, [*end.position[:2], end.deflection]])
    error = position - np.vstack([y.reference_position[first + 1 :], end.reference_position])
    # Sums of 7000 squares in another order.
    assert score.rms == pytest.approx(np.sqrt((error**2).mean(axis=0)), rel=1e-11)
    assert score.max == pytest.approx(np.abs(error).max(axis=0), rel=1e-14)
    assert score.extent == pytest.approx(np.abs(position).max(axis=0), rel=1e-14)
    assert score.max_percent == pytest.approx(100.0 * score.max / [5e-9, 5e-9, 2e-9], rel=1e-14)
    variation = np.abs(np.diff(u[first:], axis=0)).sum(axis=0) / (score.ticks * 1e-6)
    assert score.drive_total_variation == pytest.approx(variation, rel=1e-11)

    after = np.vstack([y.velocity[first + 1 :], end.velocity])
    stuck = (after[:, 0] == 0.0) & (after[:, 1] == 0.0)
    assert 0.0 < stuck.mean() < 1.0
    assert score.stick_fraction == pytest.approx(stuck.mean(), rel=1e-12)
    assert score.stick_phases == np.count_nonzero(np.diff(np.concatenate([[False], stuck]).astype(int)) == 1)
    assert score.stick_phases > 1
    normal = samples[session.column(scope, "truth/normal_force"), first + 1 :]
    # The last step's force is not among the samples yet.
    assert score.normal_force[0] <= normal.min() + 1e-18
    assert score.normal_force[1] >= normal.max() - 1e-18
    assert score.contact_fraction == 1.0


def test_what_happens_between_the_ticks_is_scored():
    # At 50 us the paper's tanh law swings between its ticks.
    values = {"plant.control_period": 5e-5, "detector.channels": "truth/position_x, truth/position_y, truth/tip_height"}
    scope = session.instrument(values | {"score.start": 1e-2})
    blocks = session.run(scope, session.controller({"law.kind": "tanh", "law.alpha": 10.0}), 4e-2)
    y, _, samples = session.joined(blocks)
    first = round(1e-2 / 1e-6) + 1
    t = 1e-6 * np.arange(samples.shape[1])
    asked = np.column_stack([5e-9 * np.sin(50.0 * t), 5e-9 * np.sin(50.0 * t), np.full(t.size, 1e-13)])
    motion = samples[[session.column(scope, f"truth/{name}") for name in ("position_x", "position_y", "tip_height")]].T
    error = (motion - asked)[first:]
    score = scope.score()
    # The very last step is not among the samples.
    assert score.rms == pytest.approx(np.sqrt((error**2).mean(axis=0)), rel=1e-3)
    assert score.max == pytest.approx(np.abs(error).max(axis=0), rel=1e-9)
    at_ticks = np.abs(y.position[:, :2] - y.reference_position[:, :2])[200:]
    assert (score.max[:2] > 1.2 * at_ticks.max(axis=0)).all()


def test_a_triangle_is_judged_between_the_ticks_as_it_is():
    # The scanner at rest: the error is the reference itself, straight between the ticks.
    values = {
        "plant.control_period": 1e-4,
        "reference.shape_x": "triangle",
        "reference.omega_x": 2000.0,
        "score.start": 0.0,
    }
    scope = session.instrument(values | {"reference.amplitude_y": 0.0})
    for _ in range(20):
        scope.tick(scope.drive)
    t = 1e-6 * np.arange(1, 2001)
    triangle = 5e-9 * 2.0 / np.pi * np.arcsin(np.sin(2000.0 * t))
    assert scope.score().rms[0] == pytest.approx(np.sqrt((triangle**2).mean()), rel=2e-3)
    # A corner between two ticks is rounded by an eighth of a period of the slope at most.
    assert scope.score().max[0] == pytest.approx(np.abs(triangle).max(), abs=5e-9 * 2000.0 * 2.0 / np.pi * 1e-4 / 8.0)


def test_what_is_scored_is_the_true_motion_and_not_what_noisy_sensors_read():
    def score(values: dict[str, float]) -> ScoreSummary:
        scope = session.instrument({"score.start": 0.0} | values)
        # In open loop the noise of the sensors moves nothing.
        session.run(scope, session.controller({"law.kind": "open_loop"}), 2e-3)
        return scope.score()

    quiet, noisy = score({}), score({"detector.noise": 1e-3, "detector.position_noise": 1e-11})
    assert row(noisy) == row(quiet)


def test_before_its_start_nothing_is_scored():
    scope = session.instrument({"score.start": 1.0})
    session.run(scope, session.controller({}), 1e-3)
    score = scope.score()
    assert score.ticks == 0
    assert np.isnan(score.rms).all()
    assert np.isnan(score.max).all()


def test_the_score_starts_after_half_a_period_unless_told_otherwise():
    assert InstrumentParameters().score_start == pytest.approx(np.pi / 50.0, rel=1e-15)
    scope = session.instrument({"plant.control_period": 1e-5, "reference.omega_x": 1000.0 * np.pi})
    session.run(scope, session.controller({}), 2e-3)
    # Half a period is 1 ms: ticks 100 to 199.
    assert scope.score().ticks == 100


def test_lost_contact_is_counted():
    scope = session.instrument({"score.start": 0.0, "plant.control_period": 1e-5})
    drive = scope.drive
    drive[2] = -50.0
    for _ in range(200):
        scope.tick(drive)
    assert not scope.in_contact
    score = scope.score()
    assert 0.0 < score.contact_fraction < 1.0
    assert score.friction[0] == 0.0
