"""The contract of a drive: one test for each row of docs/drive_contract.md, in lockstep and in realtime.

A scenario sends two good drives around the bad one. What is told: drives applied along x, state, counts.
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from afm_model.run import RunState

from .hand import PERIOD, Bench

PAGE = Path(__file__).resolve().parents[3] / "docs" / "drive_contract.md"
SLEW = 0.25 / PERIOD
"""Slew limit of a quarter of a volt in each control period [V/s]."""


@dataclass(frozen=True)
class Case:
    """What is sent while measurement 1 waits, and what it leads to after a good drive for measurement 2."""

    send: Callable[[Bench], None]
    applied: list[float]  # [V], from tick 0 on
    counts: dict[str, int]
    state: RunState = RunState.RUNNING
    values: dict[str, object] = field(default_factory=dict)


GOOD, NEXT = 1.0, 2.0


def lockstep(case: Case) -> Bench:
    """Measurement 0 is answered, then what is sent in place of an answer to 1, then, if it still waits, 1 and 2 are."""
    bench = Bench("lockstep", **case.values)
    bench.run.step()
    bench.answer(GOOD)
    case.send(bench)
    while bench.run.step():
        pass
    if bench.state == RunState.RUNNING:
        while bench.ticks < 3:
            bench.answer(GOOD if bench.ticks == 1 else NEXT)
    return bench


def realtime(case: Case) -> Bench:
    """The same by the clock: what is sent arrives between tick 1 and tick 2, before the drive for measurement 2."""
    bench = Bench("realtime", **case.values)
    bench.run.step()
    bench.link.send(0, GOOD)
    bench.at(1)
    case.send(bench)
    bench.at(2)
    bench.link.send(2, NEXT)
    bench.at(3)
    return bench


def sends(*drives: tuple[int, float]) -> Callable[[Bench], None]:
    """Drives for measurements, x in volts."""

    def send(bench: Bench) -> None:
        for sequence, x in drives:
            bench.link.send(sequence, x)

    return send


def waits(bench: Bench) -> None:
    """Nothing comes for longer than a measurement waits before it is sent again."""
    if bench.run.deadline is None:
        bench.now += 1.01
        bench.run.step()


HELD = [GOOD, GOOD, NEXT]
TABLE: dict[str, tuple[str, Case, Case]] = {
    "NaN": (
        "drives_refused",
        Case(sends((1, math.nan)), [GOOD], {"drives_refused": 1}, RunState.FAULT),
        Case(sends((1, math.nan)), HELD, {"drives_refused": 1, "drives_lost": 1}),
    ),
    "infinite": (
        "drives_refused",
        Case(sends((1, -math.inf)), [GOOD], {"drives_refused": 1}, RunState.FAULT),
        Case(sends((1, math.inf)), HELD, {"drives_refused": 1, "drives_lost": 1}),
    ),
    "out of range": (
        "drives_clipped",
        Case(sends((1, -9.0)), [GOOD, -5.0, NEXT], {"drives_clipped": 1}, values={"piezo.limit": 5.0}),
        Case(sends((1, 9.0)), [GOOD, 5.0, NEXT], {"drives_clipped": 1}, values={"piezo.limit": 5.0}),
    ),
    "too steep": (
        "drives_steep",
        Case(sends((1, 0.3)), [0.25, 0.3, 0.55], {"drives_steep": 2}, values={"piezo.slew_limit": SLEW}),
        Case(sends((1, -1.0)), [0.25, 0.0, 0.25], {"drives_steep": 3}, values={"piezo.slew_limit": SLEW}),
    ),
    "stale": (
        "drives_outdated",
        Case(sends((0, 7.0)), HELD, {"drives_outdated": 1}),
        Case(sends((0, 7.0)), HELD, {"drives_outdated": 1, "drives_lost": 1}),
    ),
    "duplicate": (
        "drives_outdated",
        Case(sends((1, GOOD), (1, 7.0)), HELD, {"drives_outdated": 1}),
        Case(sends((1, GOOD), (1, 7.0)), HELD, {"drives_outdated": 1}),
    ),
    "out of order": (
        "drives_outdated",
        Case(sends((1, GOOD), (0, 7.0)), HELD, {"drives_outdated": 1}),
        Case(sends((1, GOOD), (0, 7.0)), HELD, {"drives_outdated": 1}),
    ),
    "from the future": (
        "drives_ahead",
        Case(sends((2, 7.0), (2**63, 7.0)), HELD, {"drives_ahead": 2}),
        Case(sends((3, 7.0), (2**63, 7.0)), HELD, {"drives_ahead": 2, "drives_lost": 1}),
    ),
    "from a second publisher": (
        "drives_outdated",
        Case(sends((1, GOOD), (1, 7.0), (0, 7.0)), HELD, {"drives_outdated": 2}),
        Case(sends((1, GOOD), (1, 7.0), (0, 7.0)), HELD, {"drives_outdated": 2}),
    ),
    "malformed": (
        "drives_malformed",
        Case(lambda bench: bench.link.send_nonsense(), HELD, {"drives_malformed": 1}),
        Case(lambda bench: bench.link.send_nonsense(), HELD, {"drives_malformed": 1, "drives_lost": 1}),
    ),
    "too late": (
        "drives_lost",
        Case(waits, HELD, {"drives_lost": 1}),
        Case(waits, HELD, {"drives_lost": 1}),
    ),
}


@pytest.mark.parametrize("mode", [lockstep, realtime])
@pytest.mark.parametrize("row", TABLE)
def test_drive_that_is_not_right_has_one_outcome_and_is_counted(row: str, mode: Callable[[Case], Bench]) -> None:
    counter, *cases = TABLE[row]
    case = cases[mode is realtime]
    bench = mode(case)
    assert bench.drives[:, 0].tolist() == case.applied
    assert (bench.state, bench.counts()) == (case.state, case.counts)
    assert counter in case.counts


def test_late_drive_is_put_in_force_when_it_comes_if_no_newer_one_has() -> None:
    bench = Bench("realtime")
    bench.run.step()
    for k in range(1, 4):
        bench.at(k)
    bench.link.send(1, GOOD)
    bench.at(4)
    bench.link.send(3, NEXT)
    bench.link.send(2, 7.0)
    bench.at(5)
    assert bench.drives[:, 0].tolist() == [0.0, 0.0, 0.0, GOOD, NEXT]
    assert bench.counts() == {"drives_lost": 3, "drives_outdated": 1}


def test_table_in_the_docs_has_these_rows_and_these_counters() -> None:
    rows = re.findall(r"^\| ([^|]+) \| [^|]+ \| [^|]+ \| `(\w+)` \|$", PAGE.read_text(), re.MULTILINE)
    assert rows == [(row, counter) for row, (counter, *_) in TABLE.items()]


# The slew limit.


def test_drive_that_is_held_goes_on_towards_what_was_asked_for() -> None:
    bench = Bench("realtime", **{"piezo.slew_limit": SLEW, "run.watchdog_timeout": 1e6})
    bench.run.step()
    bench.link.send(0, 0.6)
    for k in range(1, 6):
        bench.at(k)
    assert bench.drives[:, 0] == pytest.approx([0.25, 0.5, 0.6, 0.6, 0.6])
    assert bench.counts() == {"drives_lost": 4, "drives_steep": 2}


def test_slew_limit_is_one_of_volts_per_second_whatever_the_updates_of_the_dac() -> None:
    """Four updates in a control period: each goes a quarter of the way."""
    quarter = {"piezo.dac_period": PERIOD / 4, "detector.sample_period": PERIOD / 4}
    bench = Bench("lockstep", **({"piezo.slew_limit": SLEW} | quarter))
    bench.run.step()
    for _ in range(3):
        bench.answer(10.0)
    assert bench.run.instrument.drive[0] == 0.75
    assert bench.drives[:, 0].tolist() == [0.0625, 0.3125, 0.5625]  # at the begin of each tick
    assert bench.counts() == {"drives_steep": 12}


def test_counts_of_the_drive_begin_again_with_a_reset() -> None:
    bench = Bench("lockstep", **{"piezo.limit": 5.0, "piezo.slew_limit": SLEW})
    bench.run.step()
    bench.answer(9.0)
    assert bench.counts() == {"drives_clipped": 1, "drives_steep": 1}
    bench.run.reset()
    assert bench.counts() == {}
