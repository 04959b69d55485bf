"""How a surface that is not known goes on ahead of the tip, in packets."""

import math

import numpy as np
import pytest
from model.tables import record_of
from scipy.stats import multivariate_t

from afm_model.parts.signals import Measurement
from afm_model.studies.contender import contender
from afm_model.studies.wrong_models import CASE, RATES, run_case
from afm_predictive.constants import MEAN, POINTS, VALUE
from afm_predictive.continuation import FRICTION, HEIGHT, go_on, look_ahead, solve, take_place
from afm_predictive.control import take_sample
from afm_predictive.nominal_plant import beyond
from afm_predictive.sample_estimate import begin, follow

from . import predictive_records


def records(**law):
    """Constants and state of the law in packets, with a reference that moves a radian of the surface in a period."""
    p, s = predictive_records.records(**{"period": 1e-3, "packet": 20, "surface": "observed"} | law)
    s.v[0] = s.v[1] = 0.1
    return p, s


def surface(phase, seed, waves=8):
    """Waves up to the shortest one, all alike, over the range of a surface: a phase is along the way."""
    rng = np.random.default_rng(seed)
    sizes, lengths, shifts = rng.normal(size=waves), rng.uniform(size=waves), rng.uniform(0.0, 2.0 * math.pi, waves)
    return 0.5 + 0.5 / math.sqrt(waves) * sum(
        a * math.cos(k * phase + b) for a, k, b in zip(sizes, lengths, shifts, strict=True)
    )


def wave(p, phase):
    """Height of the shortest wave."""
    return 0.5 * p.height * (1.0 - math.cos(phase))


def walk(p, s, places, height, ratio):
    """Follow height and ratio, functions of the phase, over these places along the diagonal."""
    for i, phase in enumerate(places):
        s.X = s.Y = phase / (2.0 * p.wave_number)
        for f, found, size in ((s.H, height(phase), p.height), (s.ratio, ratio(phase), p.ripple)):
            if i == 0:
                begin(f, found, size, p.ratio_noise, p)
            else:
                follow(f, found, s.X - s.at_x, s.Y - s.at_y, size, p.ratio_noise, p)
        if i > 0:
            look_ahead(height(phase), ratio(phase), p, s)
        s.at_x, s.at_y = s.X, s.Y


def ahead(p, s, c, phase):
    """What is expected at a place on the diagonal."""
    return go_on(phase / (2.0 * p.wave_number), phase / (2.0 * p.wave_number), c, s)


def test_weights_and_likelihood_are_those_of_scipy():
    p, s = records()
    rng = np.random.default_rng(2)
    for _ in range(POINTS):
        s.at_x, s.at_y = s.X, s.Y
        s.X, s.Y = s.X + rng.uniform(0.5, 1.5), s.Y + rng.uniform(0.5, 1.5)
        take_place(rng.normal(), 1.0, p, s)
    s.places[HEIGHT] = POINTS
    direction = np.array([s.X - s.at_x, s.Y - s.at_y]) / math.hypot(s.X - s.at_x, s.Y - s.at_y)
    q = p.wave_number * np.abs(direction).sum()
    off = q * (np.array(s.place) - [s.X, s.Y])
    along, beside = off @ direction, off @ [-direction[1], direction[0]]

    def alike(d):
        return np.sinc((d[:, None] - d) / math.pi)

    found = np.array(s.found)[:, HEIGHT]
    told, expected = [], []
    for noise in (1e-3, 1e-1):
        K = alike(along) * alike(beside) + noise * np.eye(POINTS)
        told.append(solve(HEIGHT, noise, 0.1, 0.7, s))
        # A wave of height 0.7 has the variance 0.7^2 / 8; its prior counts as much as four measurements.
        expected.append(2.0 * multivariate_t(np.full(POINTS, 0.1), K * 0.7**2 / 8.0, df=4).logpdf(found))
        assert np.array(s.weigh)[:, HEIGHT] == pytest.approx(np.linalg.solve(K, found - 0.1), rel=1e-7)
    assert told[1] - told[0] == pytest.approx(expected[1] - expected[0], rel=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_two_radians_ahead_a_surface_is_found_two_and_a_half_times_better_than_by_value_and_slope(seed):
    missed, by_slope = [], []
    for end in np.arange(12.0, 24.0):
        p, s = records()
        walk(p, s, np.arange(0.0, end), lambda x, size=p.height: size * surface(x, seed), lambda x: 1.0)
        true = p.height * surface(end + 1.0, seed)
        step = 2.0 / (2.0 * p.wave_number)
        missed.append((ahead(p, s, HEIGHT, end + 1.0) - true) / p.height)
        by_slope.append((beyond(s.H, step, step, p) - true) / p.height)
    rms = np.sqrt(np.mean(np.square(missed)))
    assert rms < 0.08 and rms < 0.4 * np.sqrt(np.mean(np.square(by_slope)))


def test_a_wave_of_the_shortest_length_is_continued_within_a_sixth_of_it():
    p, s = records()
    walk(p, s, np.arange(0.0, 15.0), lambda x: wave(p, x), lambda x: 1.0 + 0.5 * p.ripple * math.cos(x))
    for phase in np.linspace(14.0, 16.0, 9):
        assert ahead(p, s, HEIGHT, phase) == pytest.approx(wave(p, phase), abs=p.height / 6.0)
        assert ahead(p, s, FRICTION, phase) == pytest.approx(1.0 + 0.5 * p.ripple * math.cos(phase), abs=0.2 * p.ripple)


def test_a_step_of_friction_is_another_surface_and_height_goes_on():
    p, s = records()
    walk(p, s, np.arange(0.0, 15.0), lambda x: wave(p, x), lambda x: 1.0 if x < 13.5 else 0.9)
    assert s.places[FRICTION] == 1.0 and s.goes_on[FRICTION] == 0.0
    assert s.places[HEIGHT] == POINTS and s.goes_on[HEIGHT] == 1.0


def test_what_does_not_repeat_itself_is_not_believed_nor_continued_without_bound():
    p, s = records()
    rng = np.random.default_rng(4)
    drawn = {float(x): rng.uniform(0.0, 1.0) for x in np.arange(0.0, 15.0, 0.5)}
    walk(p, s, list(drawn), lambda x: p.height * drawn[x], lambda x: 1.0)
    far = [abs(ahead(p, s, HEIGHT, x) - s.offset_ahead[HEIGHT]) for x in np.linspace(0.0, 24.0, 97)]
    assert max(far) < 0.75 * p.height
    # At the tip it is what is followed.
    assert ahead(p, s, HEIGHT, 14.5) == pytest.approx(s.H[VALUE])
    assert s.H[MEAN] == pytest.approx(0.5 * p.height, abs=0.2 * p.height)


def test_places_farther_apart_than_the_surface_allows_are_not_continued():
    p, s = records()
    s.v[0] = s.v[1] = 0.3
    walk(p, s, np.arange(0.0, 45.0, 3.0), lambda x: wave(p, x), lambda x: 1.0)
    assert not np.any(s.goes_on)


@pytest.mark.parametrize(("packet", "places"), [(1, 0.0), (20, 9.0)])
def test_it_is_for_packets(packet, places):
    p, s = records(packet=packet)
    y = record_of(Measurement, lateral_force=p.f_0 * p.lateral_force * math.sqrt(0.5))
    for phase in range(10):
        s.X = s.Y = phase / (2.0 * p.wave_number)
        s.V_X = s.V_Y = s.fastest = 0.1
        take_sample(y, p, s)
        s.at_x, s.at_y, s.started = s.X, s.Y, 1.0
    assert list(s.places) == [places, places]


@pytest.mark.parametrize(("feedback", "near"), [("full", 5.0), ("measured", 2.0)])
def test_it_is_continued_from_the_last_place_as_far_as_that_is_known(feedback, near):
    p, s = records(feedback=feedback)
    walk(p, s, np.arange(0.0, 15.0), lambda x: wave(p, x), lambda x: 1.0)
    for phase, goes_on in ((near, 1.0), (9.0, 0.0)):
        # The tip goes on and friction is not seen: the last place stays.
        s.X = s.Y = (14.0 + phase) / (2.0 * p.wave_number)
        look_ahead(wave(p, 14.0 + phase), 0.0, p, s)
        assert np.array(s.goes_on) == pytest.approx(goes_on)


def test_from_places_that_are_estimated_it_is_continued_to_no_more_than_a_wave_reaches():
    p, s = records(feedback="measured")
    walk(p, s, np.arange(0.0, 15.0), lambda x: wave(p, 1.2 * x), lambda x: 1.0)
    far = [abs(ahead(p, s, HEIGHT, x) - s.offset_ahead[HEIGHT]) for x in np.linspace(0.0, 24.0, 97)]
    assert 0.3 * p.height < max(far) < 0.5 * p.height


@pytest.mark.parametrize(
    ("title", "median", "worst"),
    [("the truth", 3.0, 3.0), ("resonances -5 %", 3.5, 5.0), ("friction x 1.5", 8.0, 30.0)],
)
def test_in_packets_with_nothing_known_what_is_left_is_near_the_bound(title, median, worst):
    case = CASE[title]
    told = run_case(case, RATES[2], contender("predictive surface=observed"))
    assert told["third"] < median and told["worst"] < worst and not told["lost"]


@pytest.mark.parametrize(
    ("title", "surface", "most"),
    [("the truth", "observed", 12.0), ("lateral gain 0.9", "learned", 4.0), ("Lissajous 2:3", "observed", 60.0)],
)
def test_in_packets_positions_alone_are_enough_where_the_surface_is_not_known(title, surface, most):
    # Without it, the last two without friction where it lies: 16, 16 and 60 to 80.
    told = run_case(CASE[title], RATES[2], contender(f"predictive surface={surface}"), 1.0)
    assert told["third"] < most and not told["lost"]


def test_a_place_that_is_no_number_or_off_the_table_is_answered():
    p, s = records()
    walk(p, s, np.arange(0.0, 15.0), lambda x: wave(p, x), lambda x: 1.0)
    for x in (math.nan, math.inf, -math.inf, 1e300):
        assert math.isfinite(go_on(x, x, HEIGHT, s))
