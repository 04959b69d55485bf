"""Claims about what the friction-predicting law learns: reference, height and friction of the sample, the map."""

import math

import numpy as np
import pytest
from model.tables import record_of

from afm_model import ControllerParameters, build
from afm_model.parts.signals import Measurement
from afm_model.studies.contender import contender
from afm_model.studies.wrong_models import RATES, Case, run_case
from afm_predictive import PREDICTIVE
from afm_predictive.asked import continue_reference, take_reference
from afm_predictive.constants import NODES
from afm_predictive.map import read_map, write_map
from afm_predictive.nominal_plant import REACH, beyond
from afm_predictive.sample_estimate import MEAN, SLOPE_X, SLOPE_Y, VALUE, begin, follow

from .law_records import records

X0, W0 = 2.5e-10, 1e4


SINE = (
    lambda t: 20.0 * math.sin(0.005 * t) + 3.0,
    lambda t: 0.1 * math.cos(0.005 * t),
    lambda t: -5e-4 * math.sin(0.005 * t),
)
PARABOLA = (lambda t: 1.0 + 0.2 * t - 0.01 * t * t, lambda t: 0.2 - 0.02 * t, lambda t: -0.02)
LINE = (lambda t: -2.0 + 0.1 * t, lambda t: 0.1, lambda t: 0.0)


@pytest.mark.parametrize("course", [SINE, PARABOLA, LINE])
def test_a_sine_a_parabola_and_a_line_are_continued_as_they_go_on(course):
    p, s = records(period=2e-4)
    position, rate, acceleration = course
    for k in range(4):
        t = 2.0 * k
        y = record_of(
            Measurement,
            reference_position=(X0 * position(t), 0.0, 0.0),
            reference_velocity=(X0 * W0 * rate(t), 0.0, 0.0),
            reference_acceleration=(X0 * W0**2 * acceleration(t), 0.0, 0.0),
        )
        take_reference(y, p, s)
        s.started = 1.0
    continue_reference(0, 2.0, 40, p, s)
    ahead = 6.0 + 2.0 + p.tau * np.arange(41)
    # The frequency comes from differences of doubles.
    assert s.path[:41, 0, 0] == pytest.approx([position(t) for t in ahead], abs=1e-6)
    assert s.path[:41, 0, 1] == pytest.approx([rate(t) for t in ahead], abs=1e-6)


def height(along):
    """The paper's sample on its diagonal [z0]."""
    return 0.0625 * (1.0 - math.cos(along / math.sqrt(2.0)))


def test_height_and_slope_of_a_wave_are_followed():
    p, s = records()
    step = 0.07
    begin(s.H, height(0.0), p.height, p.height_noise, p)
    for k in range(1, 2000):
        aside = step / math.sqrt(2.0)
        follow(s.H, height(k * step), aside, aside, p.height, p.height_noise, p, math.nan)
        if k > 100:
            assert s.H[VALUE] == pytest.approx(height(k * step), abs=2e-4)
            slope = (s.H[SLOPE_X] + s.H[SLOPE_Y]) / math.sqrt(2.0)
            # A tenth of the steepest slope: it lags by some of its steps.
            assert slope == pytest.approx(0.0442 * math.sin(k * step / math.sqrt(2.0)), abs=4.4e-3)
    assert s.H[MEAN] == pytest.approx(0.0625, abs=0.01)


def test_far_ahead_the_mean_is_what_is_expected():
    p, s = records()
    s.H[VALUE], s.H[SLOPE_X], s.H[MEAN] = 0.1, 0.02, 0.06
    assert beyond(s.H, 0.5, 0.0, p) == pytest.approx(0.11, rel=1e-12)
    # Two radians beyond a fifth is left, of the value along its slope; then it fades as the square of the way.
    value = 0.1 + 0.02 * REACH / p.wave_number
    assert beyond(s.H, (REACH + 2.0) / p.wave_number, 0.0, p) == pytest.approx(0.06 + 0.2 * (value - 0.06), rel=1e-12)
    assert beyond(s.H, 600.0, 0.0, p) == pytest.approx(0.06, abs=2e-6)


def travel(p, s, ways, noise, rng):
    """Write the map on the way along the diagonal."""
    s.v[0] = s.v[1] = 0.1
    for along in ways:
        s.X = s.Y = along / math.sqrt(2.0)
        s.p[0] = s.p[1] = s.X
        write_map(height(along) + noise * rng.normal(), 1.0 + 0.1 * height(along), p, s)
        s.at_x, s.at_y = s.X, s.Y


def test_the_map_knows_height_and_friction_after_one_pass(rng):
    p, s = records(surface="learned")
    travel(p, s, np.arange(0.0, 40.0, 0.28), 1e-4, rng)
    for along in np.arange(12.0, 28.0, 0.3):
        s.height = s.here = math.nan
        read_map(along / math.sqrt(2.0), along / math.sqrt(2.0), p, s)
        assert s.height == pytest.approx(height(along), abs=5e-4)
        assert s.here == pytest.approx(1.0 + 0.1 * height(along), abs=5e-4)


def test_a_map_of_places_one_and_a_half_radian_apart_knows_what_is_between(rng):
    p, s = records(surface="learned")
    travel(p, s, np.arange(0.0, 50.0, 1.5 * math.sqrt(2.0)), 1e-4, rng)
    for along in np.arange(14.0, 32.0, 0.3):
        s.height = s.here = math.nan
        read_map(along / math.sqrt(2.0), along / math.sqrt(2.0), p, s)
        assert s.height == pytest.approx(height(along), abs=5e-4)
        assert s.here == pytest.approx(1.0 + 0.1 * height(along), abs=5e-4)


@pytest.mark.parametrize(("doubted", "size"), [("rise", 0.3), ("doubt", 1.0)])
def test_what_is_measured_while_the_load_rings_or_at_a_doubtful_place_hardly_changes_the_map(rng, doubted, size):
    changes = []
    for value in (0.0, size):
        p, s = records(surface="learned")
        travel(p, s, np.arange(0.0, 40.0, 0.28), 0.0, rng)
        before, s[doubted] = np.array(s.map_ratio), value
        s.X = s.Y = s.X + 0.2
        write_map(height(s.X * math.sqrt(2.0)), 1.05, p, s)
        changes.append(np.abs(s.map_ratio - before).max())
    assert changes[1] < 0.01 * changes[0]


@pytest.mark.parametrize(("packet", "most"), [(1, 1.0), (20, 0.1)])
def test_in_packets_a_tip_that_was_thrown_and_stands_still_again_hardly_changes_the_map(packet, most, rng):
    p, s = records(surface="learned", packet=packet, period=1e-3)
    travel(p, s, np.arange(0.0, 40.0, 0.28), 0.0, rng)
    before, changes = np.array(s.map_ratio), []
    covariance, behind = np.array(s.covariance), float(s.X)
    for step in (0.2, 15.0):
        s.map_ratio[:], s.covariance[:] = before, covariance
        s.at_x = s.at_y = behind + 0.2 - step
        s.X = s.Y = behind + 0.2
        write_map(height(s.X * math.sqrt(2.0)), 1.05, p, s)
        changes.append(np.abs(s.map_ratio - before).max())
    assert changes[1] < 1.01 * most * changes[0]
    assert changes[1] > 0.99 * changes[0] or packet > 1


@pytest.mark.parametrize(("factor", "most"), [(0.8, 1.0), (1.2, 5.0)])
def test_friction_that_changes_on_a_line_that_was_learned_costs_little_two_periods_later(factor, most):
    fault = {"kind": "friction", "size": factor, "start": 0.1}
    case = Case("friction changes", {f"fault.sample.{name}": value for name, value in fault.items()})
    run = run_case(case, RATES[1], contender("predictive surface=learned"), noise=1.0)
    assert run["third"] < most
    assert not run["lost"]


def test_the_map_tells_nothing_ahead_and_beside_the_line(rng):
    p, s = records(surface="learned")
    travel(p, s, np.arange(0.0, 30.0, 0.28), 0.0, rng)
    for x, y in ((23.0, 23.0), (10.0, 11.0)):
        s.height = math.nan
        read_map(x, y, p, s)
        assert math.isnan(s.height)


def test_the_covariance_of_the_map_stays_one(rng):
    p, s = records(surface="learned")
    travel(p, s, 28.0 * np.sin(np.arange(0.0, 20.0, 0.01)), 1e-4, rng)
    lower = np.tril(s.covariance)
    assert lower.shape == (NODES, NODES)
    covariance = lower + np.tril(lower, -1).T
    assert np.linalg.eigvalsh(covariance)[0] > -1e-9


@pytest.mark.parametrize(("variance", "known"), [(0.98, True), (1.02, False)])
@pytest.mark.parametrize("along", [19.0, 20.1, 20.4])
def test_the_map_counts_up_to_the_variance_that_the_page_says(variance, known, along, rng):
    p, s = records(surface="learned")
    travel(p, s, np.arange(0.0, 40.0, 0.28), 1e-4, rng)
    # Of nodes that vary as one: the variance of what is between them is that of each.
    s.covariance[:] = np.tril(np.full((NODES, NODES), variance * 0.03))
    s.mapped = 0.0
    read_map(along / math.sqrt(2.0), along / math.sqrt(2.0), p, s)
    assert s.mapped == known


def test_the_part_is_chosen_by_its_name():
    assert build(ControllerParameters, {"law.kind": "predictive"}).law.kind == PREDICTIVE.name
