"""Claims about the piezo `ceramic`: hysteresis and creep on their closed forms, by rules that know no play operator."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from afm_model import Instrument, InstrumentParameters, ParameterError, build
from afm_model.compiled.records import record_at, size
from afm_model.parts.signals import Drive
from afm_model.piezo import CERAMIC

OPENING, STROKE, SENSITIVITY = 0.12, 90e-6, 500e-9
U = 0.5 * STROKE / SENSITIVITY
"""Half the stroke [V]."""
HYSTERESIS = {
    "piezo.kind": "ceramic",
    "piezo.sensitivity_x": SENSITIVITY,
    "piezo.hysteresis_x": OPENING,
    "piezo.stroke_x": STROKE,
}


class Ceramic:
    """The part alone, one axis of it, fed with one drive a sample."""

    def __init__(self, values: dict[str, Any], start: float = 0.0) -> None:
        parameters = build(InstrumentParameters, values)
        self.p = record_at(np.zeros(size(CERAMIC.constants)), 0, CERAMIC.constants)
        for name, value in {"creep": parameters.piezo.creep, **CERAMIC.values(parameters)}.items():
            self.p[name] = value
        self.s = record_at(np.zeros(size(CERAMIC.state)), 0, CERAMIC.state)
        CERAMIC.begin(parameters, self.s, (start, 0.0, 0.0))
        self.u, self.v = (record_at(np.zeros(3), 0, Drive) for _ in range(2))

    def __call__(self, drive: np.ndarray) -> np.ndarray:
        out = np.empty(len(drive))
        for k, volts in enumerate(drive):
            self.u.voltage[0] = volts
            CERAMIC.actuate(0.0, self.u, self.v, self.p, self.s)
            out[k] = self.v.voltage[0]
        return out


def first_curve(u: np.ndarray | float) -> np.ndarray | float:
    """Rayleigh's law p u + c u^2 / 2, interpolated at the half octaves of U from U / 64 on."""
    knots = U * np.array([0.0, *2.0 ** (0.5 * np.arange(-12, 1))])
    p, c = 1.0 - 2.0 * OPENING, 4.0 * OPENING / U
    heights = p * knots + 0.5 * c * knots**2
    size = np.abs(u)
    beyond = heights[-1] + (heights[-1] - heights[-2]) / (knots[-1] - knots[-2]) * (size - U)
    return np.sign(u) * np.where(size > U, beyond, np.interp(size, knots, heights))


def by_madelung(drive: np.ndarray) -> np.ndarray:
    """Masing's and Madelung's rules: a branch is the first curve, doubled, from its reversal; a loop that closes is
    wiped out, and the branch in which it began goes on.
    """
    out = np.empty(len(drive))
    reversals: list[tuple[float, float]] = []  # drive and output, from the outermost on; none: on the first curve
    u = y = 0.0
    direction = 0
    for k, target in enumerate(drive):
        turn = int(np.sign(target - u))
        if turn and direction and turn != direction:
            reversals.append((u, y))
        direction = turn or direction
        # Beyond the reversal before the last one, a loop has closed; beyond the mirror of the first, the first curve.
        while len(reversals) >= 2 and (target - reversals[-2][0]) * direction > 0.0:
            del reversals[-2:]
        if len(reversals) == 1 and abs(target) > abs(reversals[0][0]):
            reversals.clear()
        u = target
        if reversals:
            u_r, y_r = reversals[-1]
            y = y_r + 2.0 * float(first_curve(0.5 * (u - u_r)))
        else:
            y = float(first_curve(u))
        out[k] = y
    return out


def triangle(*corners: float, points: int = 200) -> np.ndarray:
    return np.concatenate([np.linspace(a, b, points + 1)[1:] for a, b in pairwise(corners)])


def test_loop_over_the_stroke_opens_by_the_hysteresis_and_has_the_sensitivity():
    out = Ceramic(HYSTERESIS)(triangle(0.0, U, -U, U))
    falling, rising = out[200:400], out[400:600]
    assert out[199] - out[399] == pytest.approx(2.0 * U, rel=1e-12)
    assert out[599] == pytest.approx(out[199], rel=1e-12)
    # Both pass zero after 100 of 200 points.
    assert falling[99] - rising[99] == pytest.approx(OPENING * 2.0 * U, rel=1e-12)
    assert (falling[:-1] - rising[-2::-1]).max() == pytest.approx(OPENING * 2.0 * U, rel=1e-12)


def test_branches_are_the_parabolas_of_rayleigh_within_what_interpolation_leaves():
    drive = triangle(0.0, U, -U, U)
    rising = Ceramic(HYSTERESIS)(drive)[400:]
    u = drive[400:]
    p, c = 1.0 - 2.0 * OPENING, 4.0 * OPENING / U
    parabola = p * u + c * (0.25 * (u + U) ** 2 - 0.5 * U * U)
    # A chord over the widest gap, from U / sqrt(2) to U, is off by c (gap)^2 / 8, and a branch is doubled.
    bound = 2.0 * c * (U * (1.0 - math.sqrt(0.5))) ** 2 / 8.0
    assert np.abs(rising - parabola).max() < bound
    assert bound == pytest.approx(0.043 * OPENING * 2.0 * U, rel=1e-2)


@pytest.mark.parametrize("octaves", [1, 2, 4])
def test_smaller_loops_open_less_in_proportion_to_their_size(octaves):
    A = U / 2**octaves
    out = Ceramic(HYSTERESIS)(triangle(0.0, A, -A, A))
    stroke = out[199] - out[399]
    assert stroke == pytest.approx(2.0 * A * (1.0 - 2.0 * OPENING * (1.0 - A / U)), rel=1e-12)
    assert out[299] - out[499] == pytest.approx(OPENING * (A / U) * 2.0 * A, rel=1e-12)


def test_any_history_follows_the_rules_of_masing_and_madelung(rng):
    corners = [0.0, *rng.uniform(-1.3 * U, 1.3 * U, 60)]
    drive = triangle(*corners, points=12)
    np.testing.assert_allclose(Ceramic(HYSTERESIS)(drive), by_madelung(drive), rtol=0.0, atol=1e-12 * U)


def test_minor_loops_between_the_same_drives_are_congruent_whatever_came_before():
    low, high = -0.1 * U, 0.25 * U
    loops = []
    for before in ((0.0, U), (0.0, -U), (0.0, 0.6 * U, -0.7 * U)):
        out = Ceramic(HYSTERESIS)(triangle(*before, low, high, low, high, low))
        loops.append(out[-400:] - out[-401])
    assert np.ptp(loops[0]) == pytest.approx(0.35 * U * (1.0 - 2.0 * OPENING * (1.0 - 0.175)), rel=1e-3)
    for other in loops[1:]:
        np.testing.assert_allclose(other, loops[0], rtol=0.0, atol=1e-12 * U)


def test_a_loop_that_has_closed_leaves_no_trace():
    with_loop = Ceramic(HYSTERESIS)(triangle(0.0, U, -0.2 * U, 0.3 * U, -0.2 * U, -U))
    without = Ceramic(HYSTERESIS)(triangle(0.0, U, -0.2 * U, -U))
    np.testing.assert_allclose(with_loop[-200:], without[-200:], rtol=0.0, atol=1e-13 * U)


def test_hysteresis_is_the_same_at_any_speed():
    drive = triangle(0.0, U, -0.5 * U, 0.8 * U)
    slow = Ceramic(HYSTERESIS)(np.repeat(drive, 3))[2::3]
    np.testing.assert_array_equal(slow, Ceramic(HYSTERESIS)(drive))


def creep_of(period: float, times: np.ndarray, creep: float) -> np.ndarray:
    """Displacement after a step of 1 V, in samples `period` apart."""
    values = {"piezo.kind": "ceramic", "piezo.creep": creep, "detector.sample_period": period}
    ceramic = Ceramic(values | {"plant.control_period": period})
    # The drive of sample k is held from k T on; what comes of it at its end is given.
    return ceramic(np.ones(round(times[-1] / period)))[np.round(times / period).astype(int) - 1]


@pytest.mark.parametrize(
    ("period", "times"),
    [(1e-4, np.geomspace(3e-3, 0.1, 20)), (1e-2, np.geomspace(0.1, 10, 20)), (1.0, [100, 300, 1000])],
)
def test_creep_follows_the_logarithm_of_time_from_3_ms_to_1000_s(period, times):
    creep = 0.02
    times = np.round(np.asarray(times) / period) * period
    # Error: 2.5 % of what follows in a decade at the end of the range, where exponentials beyond it are missing.
    assert creep_of(period, times, creep) == pytest.approx(1.0 + creep * np.log10(times / 0.1), abs=0.025 * creep)


def test_creep_in_the_middle_of_its_range_is_exact_to_a_thousandth_of_a_decade():
    times = np.geomspace(0.1, 10.0, 30).round(2)
    assert creep_of(1e-2, times, 0.02) == pytest.approx(1.0 + 0.02 * np.log10(times / 0.1), abs=1e-3 * 0.02)


def test_amplifier_is_a_first_order_low_pass():
    values = {"piezo.kind": "ceramic", "piezo.amplifier_bandwidth": 2e3, "plant.control_period": 1e-5}
    values |= {"detector.sample_period": 1e-5}
    out = Ceramic(values, start=0.5)(np.full(100, 1.5))
    t = 1e-5 * np.arange(1, 101)
    assert out == pytest.approx(1.5 - np.exp(-2.0 * np.pi * 2e3 * t), rel=1e-12)


@pytest.mark.parametrize("plant", [{}, {"plant.kind": "lever", "sample.kind": "flat", "reference.z_r": 50e-9}])
def test_part_in_the_instrument_does_what_it_does_alone_and_starts_at_rest(plant):
    everything = HYSTERESIS | {
        "piezo.hysteresis_z": 0.1,
        "piezo.stroke_z": 1e-6,
        "piezo.creep": 0.015,
        "piezo.amplifier_bandwidth": 1e4,
        "plant.control_period": 1e-4,
        "detector.sample_period": 1e-4,
        "detector.channels": "truth/piezo_x, truth/piezo_z, truth/creep_x, truth/hysteresis_x",
    }
    parameters = build(InstrumentParameters, plant | everything)
    scope = Instrument(parameters, 200)
    start = scope.drive
    drive = 0.1 * np.sin(0.05 * np.arange(200))
    for volts in drive:
        scope.tick(np.array([volts, *start[1:]]))
    channels = dict(zip((each.name for each in scope.channels), scope.take_block().samples, strict=True))
    assert np.ptp(channels["truth/piezo_z"]) == 0.0
    alone = Ceramic(plant | everything)(drive)
    np.testing.assert_allclose(channels["truth/piezo_x"][1:], alone[:-1], rtol=0.0, atol=1e-15)
    assert np.abs(channels["truth/creep_x"]).max() > 1e-4
    assert np.abs(channels["truth/hysteresis_x"]).max() > 1e-3


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (
            {"piezo.hysteresis_x": 0.5},
            "piezo.hysteresis_x = 0.5 is not allowed: it must be a finite number >= 0 and < 0.5",
        ),
        ({"piezo.hysteresis_z": 0.1}, "piezo.stroke_z must be > 0 m"),
        ({"piezo.hysteresis_x": 0.1, "reference.amplitude_x": 0.0}, "piezo.stroke_x must be > 0 m"),
    ],
)
def test_what_cannot_be_is_refused(values, told):
    with pytest.raises(ParameterError, match=told):
        build(InstrumentParameters, {"piezo.kind": "ceramic"} | values)


def test_without_a_stroke_the_loop_is_that_of_the_scan():
    A = 2e-6
    values = {"piezo.kind": "ceramic", "piezo.hysteresis_x": 0.1, "reference.amplitude_x": A}
    volts = A / 20e-9
    out = Ceramic(values)(triangle(0.0, volts, -volts, volts))
    assert out[299] - out[499] == pytest.approx(0.1 * 2.0 * volts, rel=1e-12)


def test_what_is_implausible_is_told():
    given = {"piezo.kind": "ceramic", "piezo.hysteresis_x": 0.3, "piezo.creep": 0.1, "piezo.amplifier_bandwidth": 1.0}
    told = CERAMIC.warnings(build(InstrumentParameters, given))
    assert ["hysteresis_x" in told[0], "creep" in told[1], "amplifier" in told[2]] == [True] * 3
    assert CERAMIC.warnings(build(InstrumentParameters, HYSTERESIS | {"piezo.creep": 0.015})) == []
