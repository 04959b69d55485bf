"""Claims about the control period of an instrument that is made from a scenario with changes, and that of its law."""

import warnings
from contextlib import contextmanager
from dataclasses import replace

import pytest

from afm_model import Controller, changed, compare, load_scenario, simulate_many
from afm_model.law import TimingWarning
from afm_model.microscope import Local, Microscope, MoveTo
from afm_model.run import Latency, simulate_realtime

TOLD = r"law.period = 5e-05 s should be plant.control_period = 0.0001 s"


@pytest.fixture(scope="module")
def scenario():
    return load_scenario("two_materials")


@pytest.fixture(scope="module")
def other(scenario):
    return changed(scenario.controller, {"law.period": 5e-5})


def timing(microscope):
    local = microscope.backend
    plant, law = local.instrument.parameters.plant, local._controller.law
    return plant.control_period, law.period, plant.delay_ticks, law.delay_ticks


@pytest.mark.parametrize(
    ("plant", "expected"),
    [
        ({"kind": "lever", "gap": 3e-7}, (1e-4, 1e-4, 0, 0)),
        ({"control_period": 5e-5, "delay_ticks": 1}, (5e-5, 5e-5, 1, 1)),
        ({"kind": "lever", "control_period": 5e-5}, (5e-5, 5e-5, 0, 0)),
    ],
)
def test_the_law_of_a_preset_is_made_for_the_plant_whatever_is_changed(plant, expected):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        microscope = Microscope("two_materials", plant=plant)
    assert timing(microscope) == expected


def test_x_goes_where_it_is_sent_with_the_kind_of_the_preset_given_again():
    with Microscope("two_materials", plant={"kind": "lever", "gap": 500e-9}) as microscope:
        for x in (100e-9, 0.0):
            microscope.go_to(x=x, y=0.0)
            assert microscope.read(channels="x")["x"] == pytest.approx(x, abs=1e-11)


def test_another_probe_of_the_same_kind_keeps_the_timing_of_the_loop(scenario):
    local = Local(scenario.sim, scenario.controller)
    local.set_probe({"kind": "lever", "k": 0.3})
    plant = local.instrument.parameters.plant
    assert (plant.k, plant.control_period) == (0.3, 1e-4)
    assert local.execute(MoveTo(x=20e-9)).result.x == pytest.approx(20e-9, abs=1e-11)


def test_a_law_inside_counts_and_follows_the_control_period():
    microscope = Microscope("two_materials", law={"kind": "observer"}, plant={"control_period": 5e-5})
    assert microscope.backend._controller.law.kind == "observer"
    assert timing(microscope)[:2] == (5e-5, 5e-5)


def test_a_law_for_another_period_is_told_by_all_that_run_it(scenario, other):
    slow = replace(scenario, sim=changed(scenario.sim, {"run.duration": 1e-3}), controller=other)
    runs = [
        lambda: Microscope("two_materials", other),
        lambda: Microscope(slow),
        lambda: simulate_many(slow, {"afm_sim_node.plant.seed": [1]}),
        lambda: simulate_realtime(slow.sim, Controller(other), Latency()),
    ]
    for run in runs:
        with told(TOLD):
            run()
    with told(r"in 1 of 2 runs the law is made for another rate: law.period = 0.0002 s"):
        compare(["pid", "pid period=2e-4"], workers=1, progress=False)


@contextmanager
def told(sentence):
    """The warning comes before anything runs."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", TimingWarning)
        with pytest.raises(TimingWarning, match=sentence):
            yield
