"""Claims about what the held drive and the law as printed do to the numbers of section 4 of the paper."""

import pytest

from afm_model import ControllerParameters, ScoreSummary, SimParameters, build, simulate

from .session import LATERAL, NORMAL, PERIOD, X0

OPEN_LOOP = {"reference.z_r": 1e-9, "run.duration": 2.0 * PERIOD, "score.start": PERIOD}


def score(sim: dict[str, object], law: dict[str, object]) -> ScoreSummary:
    """Score of a run."""
    return simulate(build(SimParameters, sim), build(ControllerParameters, law)).score


@pytest.mark.parametrize(("hold", "phases"), [(1e-6, 16), (2e-6, 18), (5e-6, 16), (1e-5, 17), (2e-5, 17), (5e-5, 17)])
def test_a_held_drive_changes_the_count_of_short_rests_and_nothing_else(hold, phases):
    result = score(OPEN_LOOP | {"plant.control_period": hold}, {"law.kind": "open_loop"})
    # A rest shorter than the hold is split or merged with its neighbour.
    assert result.stick_phases == phases
    # The phase of the drive is late by half a hold, up to 0.25 units of 1257.
    assert result.stick_fraction == pytest.approx(0.5144, abs=4e-4)
    assert result.extent[:2] / X0 == pytest.approx([85.197, 123.005], abs=2e-3)


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
