"""Claims about the program `force_curve`: phases, trigger, rates; how the z loop gives z away and takes it back."""

from typing import Any

import numpy as np
import pytest

from afm_model import Instrument, InstrumentParameters, ParameterError, build
from afm_model.instrument import Block
from afm_model.parts.signals import FOLLOW, HOLD, OPEN, Detection, Drive, Setpoint
from afm_model.program import force_curve

LEVER = {
    "plant.kind": "lever",
    "plant.scanner": "stack_13um",
    "plant.tilt": 0.0,
    "plant.gap": 20e-9,
    "sample.kind": "flat",
    "onboard.kind": "pi",
    "reference.kind": "force_curve",
    "detector.channels": "z_loop, z_offset, curve_phase, curves_done, curve_triggered",
}
FREE = LEVER | {"reference.ramp": 10e-9, "reference.approach_rate": 10e-6, "reference.retract_rate": 20e-6}
"""10 nm there in 1 ms, back in 0.5 ms, without reaching the sample."""


def record(values: dict[str, Any], ticks: int) -> tuple[dict[str, np.ndarray], Instrument]:
    """Channels by name, a sample every microsecond, with nothing asked by a controller."""
    parameters = build(InstrumentParameters, values)
    scope = Instrument(parameters, ticks)
    for _ in range(ticks):
        scope.tick(np.zeros(3))
    return channels(scope, scope.take_block()), scope


def channels(scope: Instrument, block: Block) -> dict[str, np.ndarray]:
    named = zip(scope.channels, block.samples, strict=True)
    return {each.name: each.scale(scope.parameters) * row for each, row in named}


def test_phases_last_as_long_as_rates_and_ways_say():
    values = FREE | {"reference.lift": 4e-9, "reference.settle": 0.3e-3, "reference.dwell": 0.2e-3}
    read, _ = record(values, 150)
    phase = read["curve_phase"]
    lengths = [int((phase == number).sum()) for number in range(5)]
    # Lift 4 nm at 20 um/s, settle, 10 nm at 10 um/s, dwell, 10 nm at 20 um/s; a sample at each change.
    assert lengths == pytest.approx([200, 300, 1000, 200, 500], abs=2)
    assert (np.diff(phase) >= 0.0).all()
    assert build(InstrumentParameters, values).reference.longest == pytest.approx(2.2e-3)
    z = read["z_loop"] - read["z_loop"][0]
    for number, rate in ((force_curve.LIFT, -20e-6), (force_curve.APPROACH, 10e-6), (force_curve.RETRACT, -20e-6)):
        way = np.diff(z[phase == number][2:-1])
        assert way == pytest.approx(rate * 1e-6, rel=1e-6)
    assert z.min() == pytest.approx(-4e-9, rel=1e-9)
    assert z.max() == pytest.approx(6e-9, rel=1e-9)
    assert z[-1] == z.min()


def test_curves_are_repeated_and_then_z_stays_withdrawn():
    read, _ = record(FREE | {"reference.count": 3, "reference.settle": 0.0}, 300)
    assert read["curves_done"][-1] == 3.0
    assert np.count_nonzero(np.diff(read["curve_phase"]) == force_curve.SETTLE - force_curve.RETRACT) == 2
    assert len(set(read["z_loop"][5000:].tolist())) == 1
    assert read["curve_phase"][-1] == force_curve.DONE
    assert read["curve_triggered"].max() == 0.0


@pytest.mark.parametrize("trigger", [{"reference.trigger_force": 8e-9}, {"reference.trigger_voltage": 4.0}])
def test_approach_ends_at_the_trigger_within_a_sample_of_way(trigger):
    ramp = {"reference.ramp": 200e-9, "reference.approach_rate": 40e-6, "reference.retract_rate": 40e-6}
    read, _ = record(LEVER | ramp | trigger, 700)
    assert read["curve_triggered"].max() == 1.0
    volts = read["deflection"] / 10e-9
    phase = read["curve_phase"]
    # 8 nN of a spring of 0.2 N/m are 40 nm, at 10 nm/V. A sample later z has gone on by 0.04 nm; the scanner rings by
    # as much as it goes in 1 / (2 pi 22 kHz), 0.3 nm.
    at = int(np.flatnonzero(phase == force_curve.DWELL)[0])
    assert volts[at - 2] < 4.0 + 0.01
    assert volts[at] == pytest.approx(4.0, abs=0.02)
    assert volts.max() < 4.0 + 0.06
    # The way back is that of the approach, not of the ramp.
    back = read["z_offset"]
    assert 50e-9 < back.max() < 70e-9
    assert read["curve_phase"][-1] == force_curve.DONE


def test_trigger_counts_from_the_deflection_of_the_free_cantilever():
    # An offset of the detector: the free cantilever stands at 30 nm, 3 V off.
    ramp = {"reference.ramp": 200e-9, "reference.approach_rate": 40e-6, "reference.retract_rate": 40e-6}
    offset = {"cantilever.a": 0.0, "reference.trigger_voltage": 2.0}
    read, scope = record(LEVER | ramp | offset, 5)
    constants = scope._layout.record(scope._block, "detector_constants")
    constants.a = 30e-9
    blocks = []
    for _ in range(500):
        if scope.block_full:
            blocks.append(scope.take_block())
        scope.tick(np.zeros(3))
    del read
    state = scope._layout.record(scope._block, "program_state")
    assert state.fired == 1.0
    blocks.append(scope.take_block())
    assert 35e-9 < max(channels(scope, block)["z_offset"].max() for block in blocks) < 50e-9


def test_program_is_part_of_the_hash_and_reset_begins_anew():
    _, scope = record(FREE, 60)
    first = scope.trajectory_sha256()
    scope.reset()
    for _ in range(60):
        if scope.block_full:
            scope.take_block()
        scope.tick(np.zeros(3))
    assert scope.trajectory_sha256() == first
    other, _ = record(FREE | {"reference.approach_rate": 11e-6}, 60)
    assert other["z_loop"][-1] > 1e-12 + record(FREE, 60)[0]["z_loop"][-1]


def regulated(modes: list[tuple[int, float]], values: dict[str, Any]) -> np.ndarray:
    """z of the loop [m] behind each sample, when the program asks for a mode and an offset."""
    from afm_model.onboard import pi

    parameters = build(InstrumentParameters, {"onboard.kind": "pi"} | values)
    numbers = pi.PI.values(parameters)
    p, s = np.zeros(1, pi.Constants).view(np.recarray)[0], np.zeros(1, pi.State).view(np.recarray)[0]
    for name, number in numbers.items():
        p[name] = number
    pi.PI.begin(parameters, s, (0.0, 0.0, 1.0))

    d, r, u = (np.zeros(1, kind).view(np.recarray)[0] for kind in (Detection, Setpoint, Drive))
    d.deflection_voltage = -0.5
    told = []
    for mode, offset in modes:
        r.z_mode, r.z_offset = mode, offset
        getattr(pi.regulate, "py_func", pi.regulate)(0.0, d, r, u, p, s)
        told.append(float(s.z))
    return np.array(told)


def test_the_z_loop_is_opened_and_closed_without_a_jump():
    step = 30e-6 * 1e-6 * 0.5  # integral gain, sample period, error
    z = regulated(
        [(FOLLOW, 0.0), (FOLLOW, 0.0), (OPEN, 5e-9), (OPEN, 6e-9), (FOLLOW, 0.0), (HOLD, 0.0), (OPEN, -3e-9)],
        {"onboard.proportional_gain": 1e-9, "onboard.integral_gain": 30e-6},
    )
    first = 20e-9 + step
    assert z[0] == pytest.approx(first + 0.5e-9, rel=1e-12)
    assert z[1] == pytest.approx(z[0] + step, rel=1e-12)
    # Opened with whatever offset, it stays; then it moves by the change of the offset.
    assert z[2] == pytest.approx(z[1], rel=1e-12)
    assert z[3] == pytest.approx(z[1] + 1e-9, rel=1e-12)
    # Closed, it goes on from there by what the error adds.
    assert z[4] == pytest.approx(z[3] + step, rel=1e-12)
    assert z[5] == z[4]
    assert z[6] == pytest.approx(z[5], rel=1e-12)


def test_a_held_loop_is_held_against_the_program_and_limits_hold_too():
    held = regulated([(OPEN, 0.0), (OPEN, 5e-9)], {"onboard.hold": True})
    assert held.tolist() == [20e-9, 20e-9]
    limited = regulated([(OPEN, 0.0), (OPEN, 5e-9)], {"onboard.high": 22e-9})
    assert limited.tolist() == pytest.approx([20e-9, 22e-9])


def test_force_curve_of_the_plant_of_the_paper_shows_its_pull_off():
    values = {
        "plant.kind": "compliant",
        "plant.gap": 200e-9,
        "sample.beta": 0.0,
        "onboard.kind": "pi",
        "reference.kind": "force_curve",
        "reference.ramp": 350e-9,
        "reference.approach_rate": 20e-6,
        "reference.retract_rate": 20e-6,
        "reference.trigger_force": 50e-9,
        "detector.channels": "z_loop, curve_phase",
    }
    parameters = build(InstrumentParameters, values)
    ticks = round(parameters.reference.longest / parameters.plant.control_period)
    scope = Instrument(parameters, ticks)
    for _ in range(ticks):
        scope.tick(np.zeros(3))
    read = channels(scope, scope.take_block())
    k = parameters.cantilever.m_c * (2.0 * np.pi * parameters.cantilever.f_c) ** 2
    retract = read["deflection"][read["curve_phase"] == force_curve.RETRACT]
    free = read["deflection"][:100].mean()
    assert retract.size > 1000
    # 152 nN; the lumped cantilever rings behind the turn.
    assert k * (free - retract.min()) == pytest.approx(parameters.contact.pull_off_force, rel=0.05)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"reference.trigger_force": 1e-9, "reference.trigger_voltage": 1.0}, "are not allowed together: give one"),
        ({"onboard.kind": "none"}, "needs a loop inside the instrument that moves z"),
        ({"reference.ramp": 0.0}, "reference.ramp = 0.0 m is not allowed"),
        ({"reference.count": 0}, "reference.count = 0 is not allowed"),
    ],
)
def test_a_curve_that_cannot_be_is_refused_in_a_sentence(values, told):
    with pytest.raises(ParameterError, match=told):
        build(InstrumentParameters, LEVER | values)


def test_plant_that_cannot_leave_the_sample_has_no_force_curve():
    values = {"plant.kind": "paper", "onboard.kind": "pi", "reference.kind": "force_curve"}
    with pytest.raises(ParameterError, match="whose tip cannot leave the sample"):
        build(InstrumentParameters, values)
