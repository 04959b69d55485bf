"""Claims about the program `verbs`: motions of x and y as functions of time, the table of z, orders between ticks."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from afm_model import Instrument, InstrumentParameters, ParameterError, build
from afm_model.program import orders
from afm_model.program.orders import Lines, Order, Polynomial, Sampled, Step, quintic

QUICK = {
    "plant.kind": "lever",
    "plant.scanner": "stack_13um",
    "plant.gap": 20e-9,
    "plant.control_period": 40e-6,
    "sample.kind": "flat",
    "onboard.kind": "pi",
    "reference.kind": "verbs",
    "detector.sample_period": 10e-6,
    "detector.channels": "z_loop, z_offset, verb_step, verb_number, verb_done",
}
LINES = Lines(x=20e-9, y=-10e-9, angle=0.3, size=40e-9, first=-5e-9, step=2e-9, lines=3, image=160, turn=40)


def followed(motion: Polynomial | Lines, ticks: int, period: float = 40e-6) -> NDArray[np.float64]:
    """Position, velocity, acceleration of x and y asked for, (ticks, 3, 2), from the tick behind the order on."""
    scope = Instrument(build(InstrumentParameters, QUICK | {"plant.control_period": period}), ticks)
    scope.order(Order(motion))
    told = []
    for _ in range(ticks):
        asked = scope.orders.asked
        told.append([v[:2] for v in (asked.position, asked.velocity, asked.acceleration)])
        scope.tick(np.zeros(3))
    return np.array(told)[1:]


def test_velocity_and_acceleration_of_scan_lines_are_the_derivatives_of_the_position():
    period = 10e-6
    told = followed(LINES, LINES.samples, period)
    for of, name in ((0, "velocity"), (1, "acceleration")):
        slope = (told[2:, of] - told[:-2, of]) / (2.0 * period)
        # Where a turn begins the acceleration has a corner: half a step of it is the error there.
        assert slope == pytest.approx(told[1:-1, of + 1], abs=0.03 * np.abs(told[:, of + 1]).max()), name


def test_scan_lines_cover_the_frame_at_even_speed_and_turn_within_the_overscan():
    told = followed(LINES, LINES.samples // 4 + 3)[:, 0] - (LINES.x, LINES.y)
    c, s = math.cos(LINES.angle), math.sin(LINES.angle)
    fast, slow = told @ (c, s), told @ (-s, c)
    speed = LINES.size / (LINES.image * 10e-6)
    turn = LINES.turn * 10e-6
    # From the lead-in to the turn, v T / 2 and 5/16 v T beyond the frame.
    assert fast.min() == pytest.approx(-0.5 * LINES.size - 0.5 * speed * turn, abs=1e-12)
    assert fast.max() == pytest.approx(0.5 * LINES.size + 0.3125 * speed * turn, rel=1e-3)
    rows = sorted({round(float(y) * 1e12) for y in slow[np.abs(fast) < 0.4 * LINES.size]})
    assert rows == [-5000, -3000, -1000]
    assert told[-1] == pytest.approx(told[-2], abs=1e-14)


def test_quintic_joins_two_states():
    period, ticks = 1e-4, 50
    begin, end = (1e-9, 2e-7, 3e-5), (-4e-9, -5e-7, 6e-5)
    c = quintic(ticks, period, begin, end)
    T = ticks * period
    for s, state in ((0.0, begin), (1.0, end)):
        values = [np.polyval(np.polyder(c[::-1], n), s) / T**n for n in range(3)]
        assert values == pytest.approx(state, rel=1e-12)


def test_a_curve_is_followed_and_stays_at_its_end():
    told = followed(Polynomial(quintic(50, 40e-6, (0.0,) * 3, (30e-9, 0.0, 0.0)), (0.0, 5e-9), 50), 70)
    assert told[49:, 0].tolist() == [told[49, 0].tolist()] * 20
    assert told[49, 0] == pytest.approx([30e-9, 5e-9], rel=1e-12)
    assert np.abs(told[:, 1, 0]).max() == pytest.approx(1.875 * 30e-9 / 2e-3, rel=1e-3)


def test_a_sampled_motion_goes_through_its_samples_and_velocity_and_acceleration_are_its_derivatives():
    time = np.arange(41) * 100e-6
    turn = 2.0 * np.pi * time / time[-1]
    x, y = 20e-9 * (1.0 - np.cos(turn)), 5e-9 * (1.0 - np.cos(2.0 * turn))
    period = 10e-6
    told = followed(Sampled(x, y, 100e-6), 500, period)
    assert told[9:400:10, 0] == pytest.approx(np.column_stack([x, y])[1:], abs=1e-20)
    for of in (0, 1):
        slope = (told[2:400, of] - told[:398, of]) / (2.0 * period)
        assert slope == pytest.approx(told[1:399, of + 1], abs=0.02 * np.abs(told[:, of + 1]).max())
    # At its end it is at rest.
    assert told[400:, 0].tolist() == [told[400, 0].tolist()] * len(told[400:])
    assert np.abs(told[400:, 1]).max() < 1e-15


def test_z_follows_a_profile_of_any_length_in_a_table_of_any_length():
    scope = Instrument(build(InstrumentParameters, QUICK), 2000)
    profile = 3e-9 * np.sin(np.linspace(0.0, 2.0 * np.pi, 301))
    # 40 short steps up, then the profile at a value every 25 us: no multiple of a sample.
    ramps = [Step(orders.RAMP, target=(n + 1) * 0.1e-9, rate=10e-6, then=n + 1) for n in range(40)]
    steps = (
        *ramps,
        Step(orders.RAMP, target=0.0, rate=10e-6, then=41),
        Step(orders.PROFILE, profile=profile, period=25e-6),
    )
    scope.order(Order(Polynomial((0.0,), (0.0,)), steps))
    while not scope.orders.done:
        scope.tick(np.zeros(3))
    rows = {each.name: row for each, row in zip(scope.channels, scope.take_block().samples, strict=True)}
    part = rows["verb_step"] == 41.0
    offset, late = rows["z_offset"][part], np.arange(part.sum()) * 10e-6
    assert rows["z_offset"].max() == pytest.approx(4e-9)
    # The step begins at the sample behind which the one before it has ended.
    assert offset == pytest.approx(np.interp(late, np.arange(301) * 25e-6, profile), abs=1e-18)
    assert late[-1] == pytest.approx(300 * 25e-6, abs=20e-6)


def test_steps_of_z_last_as_long_as_they_say_and_ticking_stops_behind_the_last_one():
    from afm_model import Controller, ControllerParameters

    scope = Instrument(build(InstrumentParameters, QUICK), 1000)
    law = Controller(build(ControllerParameters, {"law.kind": "open_loop"}))
    steps = (
        Step(orders.REST, duration=0.3e-3, then=1),
        Step(orders.RAMP, target=5e-9, rate=10e-6, then=2),
        Step(orders.DWELL, duration=0.2e-3, then=3),
        Step(orders.RAMP, target=-5e-9, rate=20e-6),
    )
    scope.order(Order(Polynomial((0.0,), (0.0,)), steps))
    scope.close_loop(law, 1000)
    # 0.3 + 0.5 + 0.2 + 0.5 ms and the sample at which the last one ends, to the end of its tick.
    end = math.ceil((1.5e-3 + 10e-6) / 40e-6)
    assert scope.ticks == end
    assert scope.orders.done
    rows = {each.name: row for each, row in zip(scope.channels, scope.take_block().samples, strict=True)}
    lengths = [int((rows["verb_step"] == number).sum()) for number in range(4)]
    assert lengths == pytest.approx([30, 50, 20, 50], abs=2)
    z = rows["z_loop"] - rows["z_loop"][0]
    assert z.max() == pytest.approx(5e-9)
    assert z[-1] == pytest.approx(-5e-9)
    # Nothing is ordered: it goes on.
    scope.close_loop(law, 100)
    assert scope.ticks == end + 100
    assert set(scope.take_block().samples[4].tolist()) == {rows["z_loop"][-1]}


def test_reset_begins_anew_without_what_was_ordered():
    scope = Instrument(build(InstrumentParameters, QUICK), 200)
    first = scope.orders.program.tolist()
    scope.order(Order(Polynomial((1e-9, 1e-9), (0.0,), 10), (Step(orders.RAMP, target=1e-9, rate=1e-6),)))
    for _ in range(50):
        scope.tick(np.zeros(3))
    assert scope.orders.program.tolist() != first
    scope.reset()
    scope.tick(np.zeros(3))
    assert scope.orders.asked.position.tolist()[:2] == [0.0, 0.0]
    assert scope.orders.program.tolist() == first


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"onboard.kind": "none"}, "reference.kind = verbs needs a loop inside the instrument that moves z"),
        ({"plant.gap": 0.0}, "plant.gap must be > 0 m"),
    ],
)
def test_an_instrument_without_what_verbs_need_is_refused_in_a_sentence(values, told):
    with pytest.raises(ParameterError, match=told):
        build(InstrumentParameters, QUICK | values)


def test_a_program_that_takes_no_orders_says_so():
    scope = Instrument(build(InstrumentParameters, {}), 10)
    with pytest.raises(ParameterError, match=r"reference.kind = periodic takes no orders"):
        scope.order(Order(Polynomial((0.0,), (0.0,))))


@pytest.mark.parametrize(
    ("steps", "told"),
    [
        ((Step(orders.DWELL, then=1),), "then = 1 is not allowed: there are the steps 0 to 0, and the end, -1"),
        ((Step(orders.RAMP, rate=1.0, trigger=1.0, triggered=5),), "triggered = 5 is not allowed"),
        ((Step(orders.DWELL, then=-2),), "then = -2 is not allowed"),
        ((Step(orders.DWELL, then=1), Step(orders.DWELL, then=0)), "step 0 of the table of z never leads to its end"),
        ((Step(orders.RAMP, target=1e-9),), "rate = 0 is not allowed: it must be > 0 and finite"),
        ((Step(orders.RAMP, target=math.nan, rate=1.0),), "target = nan m is not allowed"),
        ((Step(orders.REST, duration=math.nan),), "duration = nan is not allowed"),
        ((Step(orders.PROFILE),), "its profile is not allowed"),
    ],
)
def test_table_that_would_never_end_is_refused_when_it_is_made(steps, told):
    with pytest.raises(ParameterError, match=told):
        Order(Polynomial((0.0,), (0.0,)), steps)


def test_table_with_a_way_back_that_a_trigger_leaves_is_allowed():
    Order(Polynomial((0.0,), (0.0,)), (Step(orders.RAMP, target=1e-9, rate=1e-6, trigger=1.0, then=0),))
