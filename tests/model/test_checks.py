"""Claims about what is told before a run: the axis, the number, the limit."""

import re

import pytest

from afm_model import ControllerParameters, SimParameters, build, load_scenario, simulate
from afm_model.law import TimingWarning
from afm_model.studies.linear import at_timing, linearise
from afm_model.studies.start_checks import start_warnings


def at(kind: str, period: float, delay: int):
    return at_timing(SimParameters(), build(ControllerParameters, {"law.kind": kind}), period, delay)


def test_loop_that_cannot_be_stable_is_told_with_axis_growth_and_limits_that_are_true():
    sim, controller = at("super_twisting", 1e-3, 1)
    (told,) = start_warnings(sim, controller)
    found = re.search(
        r"^along ([xyz]) the loop cannot be stable: .* grows by ([\d.]+) in each control period.* up to "
        r"plant.control_period = (\S+) s, and at this period up to plant.delay_ticks = (\d+)$",
        told,
    )
    assert found, told
    axis, growth, period, ticks = found.groups()
    loop = linearise(sim, controller)
    assert (axis, float(growth)) == (loop.axis, pytest.approx(loop.radius, rel=0.01))
    assert linearise(*at("super_twisting", float(period), 1)).stable
    assert not linearise(*at("super_twisting", 1.05 * float(period) // 1e-6 * 1e-6, 1)).stable
    assert linearise(*at("super_twisting", 1e-3, int(ticks))).stable


@pytest.mark.parametrize(("kind", "period", "delay"), [("pid", 5e-5, 1), ("observer", 5e-5, 6), ("tanh", 2e-6, 0)])
def test_loop_that_can_work_is_told_nothing(kind, period, delay):
    assert start_warnings(*at(kind, period, delay)) == []


def test_delay_that_the_paper_law_does_not_bear_is_told():
    (told,) = start_warnings(*at("tanh", 2e-6, 20))
    assert "plant.delay_ticks = 20" in told and "it is stable with this delay in ticks at no period" in told


def test_limit_of_a_law_that_knows_its_own_is_told_once():
    told = start_warnings(*at("tanh", 1e-4, 1))
    assert sum("along z" in sentence for sentence in told) == 1


def test_law_made_for_another_plant_is_told_so_and_by_simulate_as_well():
    sim = build(SimParameters, {"plant.delay_ticks": 3, "run.duration": 1e-4})
    controller = build(ControllerParameters, {"law.kind": "pid"})
    (told,) = start_warnings(sim, controller)
    assert told == "the law is made for another delay: law.delay_ticks = 0 should be plant.delay_ticks = 3"
    with pytest.warns(TimingWarning, match="law.delay_ticks = 0 should be plant.delay_ticks = 3"):
        simulate(sim, controller)


def test_nothing_is_told_of_z_where_a_loop_inside_the_instrument_drives_it():
    scenario = load_scenario("two_materials")
    assert start_warnings(scenario.sim, scenario.controller) == []
    paper = build(ControllerParameters, {"law.kind": "tanh", "law.cdot_z": 1e6})
    assert not [told for told in start_warnings(scenario.sim, paper) if told.startswith("along z")]
    # Where the controller drives z it is told.
    loop = scenario.sim.onboard.model_copy(update={"feedback": "external"})
    (told,) = start_warnings(scenario.sim.model_copy(update={"onboard": loop}), scenario.controller)
    assert told.startswith("along z the loop cannot be stable")
