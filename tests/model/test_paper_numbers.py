"""Claims about what the held drive and the law as printed do to the numbers of section 4 of the paper."""

from itertools import pairwise

import pytest

from afm_model import ControllerParameters, ScoreSummary, SimParameters, Simulation, build, simulate

from .rests import CHANNELS, raw_rests, rests, speed
from .session import LATERAL, NORMAL, PERIOD, X0

OPEN_LOOP = {"reference.z_r": 1e-9, "run.duration": 2.0 * PERIOD, "score.start": PERIOD}
OPEN = {"law.kind": "open_loop"}


def score(sim: dict[str, object], law: dict[str, object]) -> ScoreSummary:
    """Score of a run."""
    return simulate(build(SimParameters, sim), build(ControllerParameters, law)).score


def sampled(sim: dict[str, object]) -> Simulation:
    """An open-loop run with every step sampled that `rests` looks at."""
    return simulate(build(SimParameters, sim | {"detector.channels": CHANNELS}), build(ControllerParameters, OPEN))


@pytest.mark.parametrize(("hold", "phases"), [(1e-6, 16), (2e-6, 18), (5e-6, 16), (1e-5, 17), (2e-5, 17), (5e-5, 17)])
def test_a_held_drive_changes_the_count_of_rests_by_hiccups_and_nothing_else(hold, phases):
    run = sampled(OPEN_LOOP | {"plant.control_period": hold})
    result = run.score
    assert result.stick_phases == phases
    # As a rest ends, the held drive lets the scanner creep for a moment, by some 1e-6 x0, and it rests again.
    found = rests(run)
    assert len(found) == 16
    # The shortest are rests of their own, found again whatever the hold.
    assert [each.duration for each in found[:2]] == pytest.approx([79.6e-6, 80.5e-6], abs=2e-6 + 0.5 * hold)
    # The phase of the drive is late by half a hold, up to 0.25 units of 1257.
    assert result.stick_fraction == pytest.approx(0.5144, abs=4e-4)
    assert result.extent[:2] / X0 == pytest.approx([85.197, 123.005], abs=2e-3)


def test_the_two_rests_more_at_2_us_are_single_steps_at_3e_7_of_the_unit_of_speed():
    run = sampled(OPEN_LOOP | {"plant.control_period": 2e-6})
    spans = raw_rests(run)
    assert [span.duration for span in spans if span.duration < 20e-6] == pytest.approx([1e-6, 1e-6], rel=1e-6)
    # A single step of motion parts each of them from a long rest.
    gaps = [(before.stop, after.start) for before, after in pairwise(spans) if after.start - before.stop < 20]
    assert [stop - start for start, stop in gaps] == [1, 1]
    assert [speed(run)[start] for start, _ in gaps] == pytest.approx([9.2e-8, 3.0e-7], rel=0.1)


@pytest.mark.parametrize(
    ("values", "shortest", "number"),
    [
        ({"plant.kind": "compliant"}, 80e-6, 16),
        ({"plant.kind": "paper", "plant.z": "computed"}, 79e-6, 16),
        ({"plant.kind": "paper", "plant.z": "held"}, 49e-6, 22),
    ],
)
def test_shortest_rests_last_tens_of_microseconds(values, shortest, number):
    found = rests(sampled(OPEN_LOOP | values | {"plant.control_period": 1e-6}))
    assert len(found) == number
    assert found[0].duration == pytest.approx(shortest, abs=1.5e-6)  # a step


@pytest.mark.parametrize(("a", "kept"), [(0.84e-7, True), (0.87e-7, False), (0.875e-7, False), (0.88e-7, False)])
def test_contact_is_lost_from_an_offset_of_0_87_on(a, kept):
    result = score(OPEN_LOOP | {"cantilever.a": a, "plant.control_period": 2e-6, "score.start": 0.0}, OPEN)
    assert (result.contact_fraction == 1.0) == kept


def test_the_sgn_scenario_is_not_converged_in_the_step():
    closed = {"run.duration": PERIOD, "plant.control_period": 1e-6}
    found = {dt: score(closed | {"plant.dt": dt}, {"law.kind": "sgn"}) for dt in (1e-6, 5e-8)}
    # Digits given; the chatter may differ on another machine.
    assert [each.rms[0] / X0 for each in found.values()] == pytest.approx([0.101, 0.127], abs=1.5e-3)
    assert [each.stick_fraction for each in found.values()] == pytest.approx([0.241, 0.020], abs=2e-3)


@pytest.mark.parametrize("dt", [5e-7, 2e-7])
def test_a_finer_step_changes_none_of_the_open_loop_numbers(dt):
    fine = OPEN_LOOP | {"plant.control_period": 1e-6, "plant.dt": dt, "detector.sample_period": 1e-6}
    result = score(fine, {"law.kind": "open_loop"})
    assert result.stick_phases == 16
    # Half of the last digit given.
    assert result.stick_fraction == pytest.approx(0.5144, abs=5e-5)
    assert result.extent[:2] / X0 == pytest.approx([85.197, 123.005], abs=5e-4)
    assert [v / LATERAL for v in result.friction] == pytest.approx([12.513, 13.002], abs=5e-4)
    assert [v / NORMAL for v in result.normal_force] == pytest.approx([-0.177, 0.311], abs=5e-4)


@pytest.mark.parametrize(
    ("kind", "z", "phases", "extent"),
    [("compliant", "computed", 16, [85.197, 123.005]), ("paper", "computed", 17, [85.209, 123.009])],
)
def test_the_compliance_of_the_contact_changes_the_swing_by_less_than_a_thousandth(kind, z, phases, extent):
    values = {"plant.kind": kind, "plant.z": z, "plant.control_period": 5e-6}
    result = score(OPEN_LOOP | values, {"law.kind": "open_loop"})
    assert result.stick_phases == phases
    assert result.extent[:2] / X0 == pytest.approx(extent, abs=5e-4)  # digits given


def test_z_follows_the_topography_to_half_a_nanometre_with_the_rate_of_the_tip():
    closed = {"run.duration": PERIOD * 5.0 / 8.0, "score.start": PERIOD / 8.0, "plant.control_period": 1e-6}
    tip = score(closed, {"law.z_rate": "tip", "law.alpha": 10.0})
    sample = score(closed, {"law.z_rate": "sample", "law.alpha": 10.0})
    assert tip.rms[2] == pytest.approx(0.54e-9, rel=0.01)  # digits given
    # The rate of the piezo in its place costs a little and does not destabilise the contact.
    assert sample.rms[2] == pytest.approx(0.70e-9, rel=0.01)
