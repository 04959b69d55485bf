"""A surface that was told as known and is another: the law finds out, says so and follows what it sees."""

import math

import numpy as np
import pytest

from afm_model import Controller, ControllerParameters, Instrument, SimParameters, build, simulate
from afm_model.studies.contender import contender
from afm_model.studies.wrong_models import CASE, RATES, parameters_of, run_case
from afm_predictive.sample_estimate import doubt_surface

from .law_records import records

LAW = {"law.kind": "predictive", "law.surface": "known", "law.period": 5e-5, "law.delay_ticks": 1}


def walk(p, s, waves, height):
    """Move along the diagonal by so many waves of the surface, its height over that told."""
    for _ in range(math.ceil(40 * waves)):
        s.at_x, s.at_y = s.X, s.Y
        s.X = s.Y = s.X + math.pi / (40 * p.k_x)
        s.Q = height * p.beta * math.sin(p.k_x * s.X) ** 2 - p.delta - p.delta_load * (s.load - p.load_0)
        doubt_surface(p, s)
        s.started = 1.0


@pytest.mark.parametrize("height", [0.6, 1.5, 2.0])
def test_another_height_is_found_out_within_two_waves_and_the_true_one_is_known_again(height):
    p, s = records(surface="known")
    walk(p, s, 2, height)
    assert s.unknown == 1
    # There it was touched, should the tip be in the air next.
    assert 0.0 < s.touched <= 1.001 * height * p.beta
    walk(p, s, 3, 1.0)
    assert s.unknown == 0


@pytest.mark.parametrize("begins", [0.03, 0.0, -0.02])
def test_heights_that_a_z_sensor_moved_are_put_right_within_some_waves(begins):
    p, s = records(surface="known")
    s.zero_of_height = begins * p.beta
    walk(p, s, 6, 1.0)
    assert s.zero_of_height / p.beta == pytest.approx(0.0, abs=1e-3)
    assert s.unknown == 0


def test_heights_are_not_moved_where_the_z_sensor_was_right():
    p, s = records(surface="known", feedback="measured")
    walk(p, s, 6, 1.02)
    assert s.zero_of_height == 0.0


SLOW = {"period": 1e-3, "packet": 20}


@pytest.mark.parametrize(
    ("height", "law", "another"),
    [
        (0.99, {}, 0),
        (1.0, {}, 0),
        (1.02, {}, 0),
        (0.95, {}, 1),
        (1.05, {}, 1),
        (0.9, SLOW, 0),
        (1.1, SLOW, 0),
        (0.9, {"feedback": "measured"}, 0),
        (1.1, {"feedback": "measured"}, 0),
    ],
)
def test_a_surface_slightly_wrong_counts_as_another_only_where_one_that_is_seen_is_better(height, law, another):
    p, s = records(surface="known", **law)
    walk(p, s, 5, height)
    assert s.unknown == another


def test_one_measurement_alone_is_no_other_surface():
    p, s = records(surface="known")
    walk(p, s, 2, 1.0)
    s.at_x, s.at_y, s.X, s.Y, s.Q = s.X, s.Y, s.X + 0.5, s.Y + 0.5, 10.0
    doubt_surface(p, s)
    assert s.unknown == 0


def test_a_surface_that_was_not_told_is_never_known():
    assert records(surface="observed")[1].unknown == records(surface="learned")[1].unknown == 1


@pytest.mark.parametrize(
    ("title", "rate", "most"),
    [("height x 2", 0, 0.8), ("height x 2", 1, 1.2), ("drift 1 nm/s", 0, 7.6), ("drift 1 nm/s", 1, 7.7)],
)
def test_told_as_known_another_surface_leaves_no_more_than_one_that_is_not_known(title, rate, most):
    told = run_case(CASE[title], RATES[rate], contender("predictive surface=known"))
    assert told["third"] < most and not told["lost"]


def test_it_says_so():
    sim, controller = parameters_of(CASE["height x 2"], RATES[1], contender("predictive surface=known"))
    remark = simulate(sim, controller).remark
    assert remark == "the height measured is not that of sample.*: the surface is followed as law.surface = observed"


@pytest.mark.parametrize("rate", RATES, ids=[rate.title for rate in RATES])
@pytest.mark.parametrize("seed", range(2))
def test_noise_is_no_other_surface(rate, seed):
    sim, controller = parameters_of(CASE["noise"], rate, contender("predictive surface=known"), seed=seed)
    assert isinstance(sim, SimParameters) and controller.law.feedback == "measured"
    assert simulate(sim, controller).remark == ""


def test_a_tip_in_the_air_measures_no_height():
    sim = build(SimParameters, {"plant.control_period": 5e-5, "plant.delay_ticks": 1})
    law = Controller(build(ControllerParameters, LAW))
    instrument, lifted = Instrument(sim, 2000), 0
    for tick in range(2000):
        drive = np.array(law.answer(instrument.measurement, tick * 5e-5))
        if 1000 <= tick < 1400:
            drive[2] = -1e-6 / sim.piezo.sensitivity_z
        instrument.tick(drive, tick)
        lifted += instrument.truth.contact == 0.0
        assert law.state.unknown == 0
    # For longer than a wave of the surface.
    assert lifted > 200
