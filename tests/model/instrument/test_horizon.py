"""Claims about drives sent ahead: when each is in force, in the compiled loop and tick by tick."""

import math
import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from pydantic import Field

from afm_model import Command, Controller, DriveError, Instrument, InstrumentParameters, ParameterError, build
from afm_model.parts import Law, LawParameters, Record, kernel
from afm_model.run import Replay

from .. import session

PERIOD, DAC = 2e-5, 5e-6
"""Control period and time between two updates of the DAC in these tests [s]."""


def instrument(block_ticks: int = 100, **values: object) -> Instrument:
    base = {"plant.control_period": PERIOD, "piezo.dac_period": DAC, "score.start": 0.0}
    base |= {"detector.channels": "drive_x,drive_y,drive_z"}
    return Instrument(
        build(InstrumentParameters, base | {k.replace("__", "."): v for k, v in values.items()}), block_ticks
    )


def ramp(scope: Instrument, first: float, count: int, period: float = DAC) -> Command:
    """x counts upwards by 1 mV from drive to drive, z stays."""
    drives = np.tile(scope.drive, (count + 1, 1))
    drives[:, 0] = first + 1e-3 * np.arange(count + 1)
    return Command(drives[0], drives[1:], period)


def x_at_updates(scope: Instrument) -> list[float]:
    """Drive x in mV at each update of the DAC up to now."""
    samples = scope.take_block().samples[session.column(scope, "drive_x")]
    return np.round(1e3 * samples[:: round(DAC / scope.parameters.detector.sample_period)], 9).tolist()


def test_drives_of_a_horizon_act_at_their_times_and_the_last_one_is_held():
    scope = instrument()
    scope.tick(ramp(scope, 1e-3, 2))
    assert x_at_updates(scope) == [1, 2, 3, 3]


def test_horizon_goes_on_while_older_answers_are_held_and_is_dropped_by_a_newer_one():
    scope = instrument()
    plan = ramp(scope, 1e-3, 9)
    scope.tick(plan)
    scope.tick(plan, sequence=0)
    scope.tick(scope.drive * 0.0 + [0.5, 0.0, scope.drive[2]])
    assert x_at_updates(scope) == [1, 2, 3, 4, 5, 6, 7, 8, 500, 500, 500, 500]


def test_answer_that_comes_late_begins_where_its_times_say():
    scope = instrument()
    rest = scope.drive
    late = ramp(scope, 1e-3, 9)
    scope.tick(rest, sequence=-1)
    scope.tick(late, sequence=0)
    assert x_at_updates(scope) == [0, 0, 0, 0, 5, 6, 7, 8]


def test_delayed_answer_begins_where_its_times_say():
    scope = instrument(plant__delay_ticks=2)
    for k in range(4):
        scope.tick(ramp(scope, 0.1 * (k + 1), 11))
    assert x_at_updates(scope) == [0] * 8 + [108, 109, 110, 111] + [208, 209, 210, 211]


def test_horizon_is_sampled_at_the_updates_of_the_dac():
    scope = instrument(piezo__dac_period=2 * DAC)
    scope.tick(ramp(scope, 1e-3, 3))
    assert x_at_updates(scope) == [1, 1, 3, 3]
    scope = instrument(piezo__dac_period=0.0)
    scope.tick(ramp(scope, 1e-3, 3))
    assert x_at_updates(scope) == [1, 1, 1, 1]


def test_measurement_tells_which_drives_are_in_force_and_on_their_way():
    scope = instrument(plant__delay_ticks=2)
    told = []
    for k in range(5):
        y = session.measured(scope)
        told.append((int(y.drive_sequence), int(y.newest_drive_sequence)))
        scope.tick(scope.drive, sequence=k if k != 3 else 2)
    assert told == [(-1, -1), (-1, 0), (-1, 1), (0, 2), (1, 2)]


def test_queue_is_as_the_page_of_the_drive_contract_shows_it():
    page = (Path(__file__).resolve().parents[3] / "docs" / "drive_contract.md").read_text()
    rows = re.search("<!-- queue -->\n```\n(.*)```", page, re.DOTALL)[1].splitlines()
    shown = {row[:25].strip(): row[25:67].split() for row in rows}

    def run(*, ahead: int, lost: int = -1) -> tuple[list[str], ...]:
        """Rows of a run: a drive in mV is 10 per answer, 1 per place in the horizon."""
        scope = instrument(plant__delay_ticks=2, piezo__dac_period=0.0)
        newest, sequence, forces = [], [], []
        for k in range(7):
            y = session.measured(scope)
            newest.append(str(y.newest_drive_sequence))
            sequence.append(str(y.drive_sequence))
            answer, place = divmod(round(1e3 * y.drive[0]), 10)
            forces.append("start" if y.drive_sequence < 0 else f"a{answer - 1}" + (f"[{place}]" if ahead else ""))
            n = k - 1 if k == lost else k
            scope.tick(ramp(scope, 1e-2 * (n + 1), ahead, PERIOD), sequence=n)
        return newest[:6], sequence[:6], forces[1:]

    newest, sequence, forces = run(ahead=0)
    assert (shown["newest_drive_sequence"], shown["drive_sequence"]) == (newest, sequence)
    assert shown["in force from now on"] == forces
    assert shown["with a horizon"] == run(ahead=5)[2]
    assert shown["with a3 lost"] == run(ahead=5, lost=3)[2]
    assert run(ahead=0, lost=3)[2][-1] == "a2"


def test_every_update_counts_in_the_total_variation_of_the_drive():
    scope = instrument()
    scope.tick(ramp(scope, 1e-3, 3))
    scope.tick(ramp(scope, 1e-3, 3))
    # From 4 mV back to 1 mV and up again.
    assert scope.score().drive_total_variation[0] * 2 * PERIOD == pytest.approx(9e-3)


def test_range_and_resolution_hold_for_every_drive_of_a_horizon():
    scope = instrument(piezo__limit=0.05, piezo__dac_bits=8)
    scope.tick(ramp(scope, 0.0487, 3))
    lsb = 0.1 / 2**8
    assert x_at_updates(scope) == pytest.approx([1e3 * lsb * steps for steps in (125, 127, 127, 127)], abs=1e-6)


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (lambda z: (np.zeros(2), np.zeros((1, 3)), 1.0), "it must be three voltages"),
        (lambda z: (np.zeros(3), np.zeros((1, 2)), 1.0), "n rows of three voltages"),
        (lambda z: (np.zeros(3), np.zeros((513, 3)), 1.0), "512 are the most"),
        (lambda z: (np.zeros(3), np.zeros((1, 3)), 0.0), "finite and > 0"),
        (lambda z: (np.zeros(3), np.zeros((1, 3)), math.nan), "finite and > 0"),
        (lambda z: (np.zeros(3), np.zeros((1, 3)), math.inf), "finite and > 0"),
        (lambda z: (np.zeros(3), np.array([[0.0, 0.0, z], [0.0, math.nan, z]]), 1.0), "drive 1 of the horizon"),
    ],
)
def test_horizon_that_cannot_be_meant_is_refused_with_a_sentence_and_moves_nothing(command, reason):
    scope = instrument()
    before = scope.trajectory_sha256()
    with pytest.raises(DriveError, match=reason):
        scope.tick(Command(*command(scope.drive[2])))
    assert (scope.ticks, scope.trajectory_sha256()) == (0, before)
    scope.tick(scope.drive)


class Ahead(LawParameters):
    """What the law below answers."""

    count: int = Field(3, description="drives in the horizon")
    period: float = Field(DAC, description="horizon_period [s]")


class Constants(Record):
    count: int
    period: float


class State(Record):
    ticks: float


@kernel
def control(t, y, u, p, s):
    s.ticks += 1.0
    for axis in range(3):
        u.voltage[axis] = y.drive[axis]
    u.voltage[0] = 1e-3 * s.ticks
    u.horizon_period = p.period
    u.horizon_count = p.count
    for i in range(min(p.count, 512)):
        for axis in range(3):
            u.horizon[i, axis] = u.voltage[axis]
        u.horizon[i, 0] += 1e-4 * (i + 1)


AHEAD = Law(
    name="ahead",
    parameters=Ahead,
    constants=Constants,
    state=State,
    values=lambda parameters: {"count": parameters.law.count, "period": parameters.law.period},
    control=control,
)


def law(monkeypatch: pytest.MonkeyPatch, **values: object) -> Controller:
    """A law of somebody else's that sends a horizon."""
    module = ModuleType("looks_ahead")
    module.AHEAD = AHEAD
    monkeypatch.setitem(sys.modules, "looks_ahead", module)
    return session.controller({"law.kind": "looks_ahead:AHEAD"} | {f"law.{k}": v for k, v in values.items()})


@pytest.fixture
def ahead(monkeypatch):
    return law(monkeypatch)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_law_with_a_horizon_gives_the_same_bytes_compiled_and_tick_by_tick(ahead, delay):
    loop, one = instrument(plant__delay_ticks=delay), instrument(plant__delay_ticks=delay)
    loop.close_loop(ahead, 50)
    ahead.reset()
    for _ in range(50):
        answer = ahead.answer(one.measurement)
        assert isinstance(answer, Command)
        one.tick(answer)
    assert loop.trajectory_sha256() == one.trajectory_sha256()
    assert x_at_updates(loop) == x_at_updates(one)


@pytest.mark.parametrize(
    ("values", "reason"), [({"period": 0.0}, "horizon_period = 0.0 s"), ({"count": 513}, "a horizon of 513 drives")]
)
def test_law_that_writes_a_horizon_that_cannot_be_is_refused_in_both_loops(monkeypatch, values, reason):
    scope = instrument()
    for step in (lambda law: scope.close_loop(law, 1), lambda law: scope.tick(law.answer(scope.measurement))):
        with pytest.raises(DriveError, match=reason):
            step(law(monkeypatch, **values))
        assert scope.ticks == 0


@pytest.mark.parametrize("delay", [0, 2])
def test_recorded_updates_are_replayed_to_the_last_bit(ahead, delay):
    scope = instrument(plant__delay_ticks=delay)
    scope.close_loop(ahead, 40)
    block = scope.take_block()
    rows = [session.column(scope, f"drive_{axis}") for axis in "xyz"]
    updates = block.samples[rows][:, :: round(DAC / scope.parameters.detector.sample_period)].T.reshape(40, -1, 3)
    again = instrument(plant__delay_ticks=delay)
    replay = Replay(updates, delay, DAC)
    for _ in range(40):
        again.tick(replay.answer(again.measurement))
    assert again.trajectory_sha256() == scope.trajectory_sha256()


def test_recording_with_several_updates_in_a_tick_is_replayed_from_its_channels_or_not_at_all():
    parameters = instrument(plant__delay_ticks=1).parameters
    every = round(DAC / parameters.detector.sample_period)
    drives = np.arange(3.0 * 4 * 4).reshape(4, 4, 3)
    samples = np.repeat(drives.reshape(-1, 3), every, axis=0)
    channels = {f"drive_{axis}": SimpleNamespace(values=samples[:, i]) for i, axis in enumerate("xyz")}
    told = Replay.of(SimpleNamespace(drive=drives[:, 0], channels=channels), parameters).answer(np.zeros(23))
    assert np.array_equal([told.voltage, *told.horizon], drives[:2].reshape(-1, 3))
    with pytest.raises(ParameterError, match=r"of channel drive_x nothing was recorded; detector\.channels must name"):
        Replay.of(SimpleNamespace(drive=drives[:, 0], channels={}), parameters)
    with pytest.raises(ParameterError, match="80 samples of the drive in 5 ticks cannot be replayed"):
        Replay.of(SimpleNamespace(drive=np.zeros((5, 3)), channels=channels), parameters)


def test_replay_of_updates_asks_for_what_it_needs():
    with pytest.raises(ParameterError, match="dac_period, which must be > 0 s"):
        Replay(np.zeros((5, 4, 3)))
    with pytest.raises(ParameterError, match=r"plant\.delay_ticks = 200"):
        Replay(np.zeros((5, 4, 3)), 200, DAC)


@pytest.mark.parametrize("period", [3e-6, 7e-6, 4e-5])
def test_period_of_the_dac_must_fit_the_others(period):
    with pytest.raises(ParameterError, match=r"piezo\.dac_period"):
        build(
            InstrumentParameters,
            {"plant.control_period": PERIOD, "piezo.dac_period": period, "detector.sample_period": 2e-6},
        )
