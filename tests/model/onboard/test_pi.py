"""Claims about the z loop inside the instrument."""

import math
from typing import Any

import numpy as np
import pytest

from afm_model import Instrument, InstrumentParameters, ParameterError, build
from afm_model.onboard import PI

from ..session import Z_LOOP

LEVER = Z_LOOP | {"detector.channels": "z_loop, z_loop_error, truth/position_z"}
SENSITIVITY = 10e-9


def record(values: dict[str, Any], ticks: int) -> tuple[dict[str, np.ndarray], Instrument]:
    """Channels by name, with nothing asked by a controller."""
    parameters = build(InstrumentParameters, LEVER | values)
    scope = Instrument(parameters, ticks)
    for _ in range(ticks):
        scope.tick(np.zeros(3))
    samples = scope.take_block().samples
    named = zip(scope.channels, samples, strict=True)
    return {each.name: each.scale(parameters) * row for each, row in named}, scope


def test_loop_holds_the_start_without_a_controller():
    read, scope = record({}, 200)
    assert scope.drive[2] == 0.0
    assert np.ptp(read["z_loop"]) < 1e-13
    assert np.abs(read["truth/position_z"] - read["truth/position_z"][0]).max() < 1e-12


@pytest.mark.parametrize("how", ["voltage", "force"])
def test_error_decays_by_the_integral_gain_over_the_sensitivity(how):
    # On a stiff contact the deflection follows z one to one: e' = -I / S e.
    setpoint = {"voltage": {"onboard.setpoint_voltage": 5.5}, "force": {"onboard.setpoint_force": 55e-9 * 0.2}}[how]
    read, _ = record({"onboard.integral_gain": 30e-6} | setpoint, 100)
    error = read["z_loop_error"]
    assert error[1] == pytest.approx(0.5, abs=1e-3)
    rate = -np.polyfit(np.arange(200, 1500) * 1e-6, np.log(error[200:1500]), 1)[0]
    # The contact gives way by 1/133 of a turn of 0.2 N/m; the scanner's delay, Q / (pi f) = 1e-5 s, is 3 % of the time.
    assert rate == pytest.approx(30e-6 / SENSITIVITY, rel=2e-2)


def test_sum_of_both_gains_is_what_the_drive_is_at_every_sample():
    gains = {"onboard.integral_gain": 20e-6, "onboard.proportional_gain": 2e-9, "onboard.setpoint_voltage": 5.2}
    read, _ = record(gains, 50)
    error, z = read["z_loop_error"], read["z_loop"]
    integral = z[1] - 2e-9 * error[1] + np.cumsum(20e-6 * 1e-6 * error[2:])
    # The first sample is taken before the loop has run.
    assert z[2:] == pytest.approx(integral + 2e-9 * error[2:], abs=1e-18)
    assert np.ptp(error) > 0.05


def test_integral_does_not_wind_up_at_a_limit():
    # Out of reach: 100 nm from the sample, z ends 20 nm short of it.
    free = {"plant.gap": 100e-9, "onboard.setpoint_voltage": 1.0, "onboard.integral_gain": 2e-3}
    parameters = build(InstrumentParameters, LEVER | free)
    start = Instrument(parameters).drive[2] * 20e-9
    limit = {"onboard.high": start + 80e-9, "onboard.low": start - 1e-6}
    read, scope = record(free | limit, 100)
    assert read["z_loop"].max() == start + 80e-9
    state = scope._layout.record(scope._block, "onboard_state")
    assert state.integral == pytest.approx(start + 80e-9, abs=1e-12)
    # The loop leaves the limit with the first sample of the other sign.
    constants = scope._layout.record(scope._block, "onboard_constants")
    constants.setpoint = -1.0
    scope.tick(np.zeros(3))
    assert state.z < start + 80e-9


def test_integral_does_not_wind_up_at_the_range_of_the_piezo():
    # The setpoint takes some 80 nm, the piezo reaches to 50 nm: z is what the piezo does, no more.
    pressed = {"plant.gap": 40e-9, "onboard.setpoint_voltage": 8.0, "onboard.integral_gain": 1e-4, "piezo.limit": 2.5}
    read, _ = record(pressed, 100)
    assert read["z_loop"].max() == read["z_loop"][-1] == pytest.approx(50e-9, rel=1e-12)
    assert read["z_loop_error"][-1] > 1.0


def test_drive_of_the_loop_goes_through_the_converter_of_the_piezo():
    values = {"onboard.setpoint_voltage": 5.2, "piezo.limit": 10.0, "piezo.dac_bits": 12}
    read, _ = record(values | {"detector.channels": "z_loop, truth/piezo_z"}, 20)
    levels = read["truth/piezo_z"][1:] / (20.0 / 2**12)
    assert levels == pytest.approx(np.round(levels), abs=1e-9)
    assert len(set(levels.tolist())) > 1
    assert np.abs(read["truth/piezo_z"] - read["z_loop"] / 20e-9)[1:].max() <= 10.0 / 2**12 * (1.0 + 1e-9)


def test_hold_keeps_z_where_it_is():
    read, _ = record({"onboard.hold": True, "onboard.setpoint_voltage": 9.0}, 50)
    assert len(set(read["z_loop"][2:].tolist())) == 1


def test_loop_approaches_the_sample_and_rests_at_its_setpoint():
    approach = {"plant.gap": 20e-9, "onboard.setpoint_force": 5e-9, "onboard.integral_gain": 30e-6}
    read, scope = record(approach, 3000)
    force = 0.2 * read["deflection"][-2000:]
    assert scope.in_contact
    assert force.mean() == pytest.approx(5e-9, rel=1e-3)
    assert math.isclose(float(scope.state.shown), 25e-9, rel_tol=1e-2)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"onboard.low": 1e-6, "onboard.high": 0.0}, "it must be < onboard.high"),
        ({"onboard.setpoint_voltage": 1.0, "onboard.setpoint_force": 1e-9}, "are not allowed together"),
        ({"onboard.integral_gain": -1.0}, "must be a finite number >= 0"),
    ],
)
def test_what_cannot_be_is_refused(values, told):
    with pytest.raises(ParameterError, match=told):
        build(InstrumentParameters, LEVER | values)


def test_a_setpoint_as_force_needs_a_cantilever_with_a_spring_constant():
    values = {"onboard.kind": "pi", "onboard.setpoint_force": 1e-9}
    with pytest.raises(ParameterError, match=r"give onboard\.setpoint_voltage"):
        build(InstrumentParameters, values)


def test_gain_that_makes_the_resonance_of_the_scanner_oscillate_is_told_with_its_limit():
    # Without friction and damping but the scanner's own: S w / Q = 10 nm/V 2 pi 5 kHz / 20.
    free = {"plant.scanner": "flexure_90um", "onboard.setpoint_voltage": 5.0}
    limit = 10e-9 * 2.0 * math.pi * 5e3 / 20.0
    for part, grows in ((0.8, False), (1.25, True)):
        values = LEVER | free | {"onboard.integral_gain": part * limit}
        told = PI.warnings(build(InstrumentParameters, values))
        assert bool(told) == grows
        read, _ = record(values | {"onboard.setpoint_voltage": 5.02}, 1000)
        swing = [np.ptp(piece) for piece in np.split(read["deflection"][:20_000], 10)]
        assert (swing[-1] > swing[3]) == grows
    assert "take less than 1.57e-05 m/(V s)" in told[0]
    default = build(InstrumentParameters, LEVER | {"plant.scanner": "tube_100um"})
    assert PI.warnings(default) == []
