"""Claims about changing parameters: what stays if a part is exchanged, and if its own kind is given again."""

import pytest

from afm_model import ControllerParameters, build, changed, flatten, load_scenario


@pytest.fixture(scope="module")
def sim():
    return load_scenario("two_materials").sim


@pytest.mark.parametrize("group", ["plant", "sample", "onboard", "piezo", "detector", "reference"])
def test_the_own_kind_given_again_changes_nothing(sim, group):
    assert changed(sim, {f"{group}.kind": getattr(sim, group).kind}) == sim


def test_another_plant_keeps_the_timing_of_the_loop_and_what_both_have_by_a_common_class(sim):
    given = changed(sim, {"plant.k": 0.3, "plant.Q": 200.0, "plant.delay_ticks": 2, "plant.seed": 7, "plant.gap": 1e-7})
    values = {"onboard.kind": "dynamic", "onboard.feedback": "off", "onboard.drive_amplitude": 1e-9}
    values |= {"plant.kind": "averaged", "onboard.regulate": "amplitude", "onboard.setpoint_force": 0.0}
    averaged = changed(given, values).plant
    assert (averaged.k, averaged.delay_ticks, averaged.seed) == (0.3, 2, 7)
    assert averaged.control_period == sim.plant.control_period == 1e-4
    assert averaged.dt == sim.plant.dt


def test_names_that_two_parts_have_by_chance_do_not_stay(sim):
    news = {"sample.kind": "grating"}
    assert sim.sample.width != 0.0 and "width" in flatten(sim.sample)
    own = build(type(sim).origin, {"plant.kind": "lever", "piezo.limit": 50.0, **news}).sample
    assert changed(sim, news).sample == own


def test_a_law_of_another_kind_has_its_own_gains_and_the_timing_of_the_one_before():
    pid = build(ControllerParameters, {"law.kind": "pid", "law.period": 1e-4, "law.delay_ticks": 2})
    other = changed(pid, {"law.kind": "super_twisting"}).law
    assert (other.period, other.delay_ticks) == (1e-4, 2)
    assert other == type(other)(period=1e-4, delay_ticks=2)
