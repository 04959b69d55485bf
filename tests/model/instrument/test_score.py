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
    position = np.column_stack([y.position[:, :2], y.deflection])[first:]
    error = position - y.reference_position[first:]
    # Sums of 7000 squares in another order.
    assert score.rms == pytest.approx(np.sqrt((error**2).mean(axis=0)), rel=1e-11)
    assert score.max == pytest.approx(np.abs(error).max(axis=0), rel=1e-14)
    assert score.extent == pytest.approx(np.abs(position).max(axis=0), rel=1e-14)
    assert score.max_percent == pytest.approx(100.0 * score.max / [5e-9, 5e-9, 2e-9], rel=1e-14)
    variation = np.abs(np.diff(u[first:], axis=0)).sum(axis=0) / (score.ticks * 1e-6)
    assert score.drive_total_variation == pytest.approx(variation, rel=1e-11)

    # What a step did stands in the measurement after it.
    after = np.vstack([y.velocity[first + 1 :], session.measured(scope).velocity])
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
