"""Faults to order give the same bits, however and whenever they were ordered."""

import math

import numpy as np
import pytest

from afm_model import Controller, Instrument, SimParameters, flatten, simulate
from afm_model.core.random_numbers import bits, normal, uniform
from afm_model.fault import faults_of, table
from afm_model.instrument import faults as faults_of_instrument
from afm_model.run import Replay, recorded_parameters

from .test_schedule import ALL, BEGIN, LAW, PERIOD, TICKS, Asked, changed, fault, parameters


def test_the_law_in_compiled_code_and_one_called_from_python_see_the_same_faults() -> None:
    given = parameters(*ALL)
    once, again = simulate(given, LAW), simulate(given, LAW)
    python = simulate(given, Asked())
    assert once.trajectory_sha256 == again.trajectory_sha256 == python.trajectory_sha256
    np.testing.assert_array_equal(once.measurements, python.measurements)


def test_another_seed_is_another_run() -> None:
    one, other = (
        simulate(parameters(fault(kind="noise", signal="position_x", size=1e-11, seed=i)), LAW) for i in (1, 2)
    )
    assert one.trajectory_sha256 != other.trajectory_sha256
    assert changed(one.measurements["position"], other.measurements["position"])[0] == BEGIN


def test_a_fault_that_has_not_begun_changes_nothing() -> None:
    later = [each | {key: 1.0 for key in each if key.endswith(".start")} for each in ALL]
    quiet, ordered, none = (
        simulate(given, LAW) for given in (parameters(), parameters(*later), parameters({"fault.kind": "none"}))
    )
    assert quiet.trajectory_sha256 == ordered.trajectory_sha256 == none.trajectory_sha256


@pytest.mark.parametrize("order", range(len(ALL)))
def test_a_fault_that_is_ordered_on_the_way_is_the_one_that_was_there_from_the_start(order: int) -> None:
    given = parameters(*ALL)
    scope = Instrument(parameters(*(each for i, each in enumerate(ALL) if i != order)), TICKS)
    law = Controller(LAW)
    scope.close_loop(law, BEGIN - 1)
    scope.set_faults(given)
    scope.close_loop(law, TICKS - BEGIN + 1)
    assert scope.ticks == TICKS
    assert scope.trajectory_sha256() == simulate(given, LAW).trajectory_sha256
    # And again from the start.
    scope.take_block()
    scope.reset()
    law.reset()
    scope.close_loop(law, TICKS)
    assert scope.trajectory_sha256() == simulate(given, LAW).trajectory_sha256


def in_turn(step: int) -> list[dict[str, object]]:
    """Something of everything, one after the other: each begins `step` ticks after the one before and lasts for 40."""
    names = "jihgfedcba"  # another order than that of the begins
    return [
        {key.replace(f".{old}.", f".{new}."): value for key, value in each.items()}
        | {f"fault.{new}.start": (10 + step * i) * PERIOD, f"fault.{new}.duration": 40 * PERIOD}
        for i, (old, new, each) in enumerate(zip("abcdefghij", names, ALL, strict=True))
    ]


@pytest.mark.parametrize("places", [4, 6])
def test_a_fault_that_takes_its_place_late_and_leaves_it_early_changes_no_bit(
    places: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Two at a time, the one that has drifted, and one that begins while two others are ending.
    given = parameters(*in_turn(25))
    known_all_the_time = simulate(given, LAW)
    filled = []

    def short(parameters: SimParameters, tick: int) -> object:
        filled.append(tick)
        return table(parameters, tick, places)

    monkeypatch.setattr(faults_of_instrument, "table", short)
    for law in (LAW, Asked()):
        run = simulate(given, law)
        assert run.trajectory_sha256 == known_all_the_time.trajectory_sha256
        np.testing.assert_array_equal(run.measurements, known_all_the_time.measurements)
    assert len(set(filled)) > 10 // places


def test_more_faults_than_places_come_and_go_and_a_reset_brings_all_of_them_back() -> None:
    """As many as are ordered in a long life, a few at a time."""
    rounds = [
        {key.replace("fault.", f"fault.n{n}"): value for key, value in each.items()}
        for n in range(5)
        for each in in_turn(5)
        if "thermal" not in each.values()
    ]
    starts = [next(key for key in each if key.endswith(".start")) for each in rounds]
    for i, (each, start) in enumerate(zip(rounds, starts, strict=True)):
        each[start] = (10 + 5 * i) * PERIOD
    given = parameters(*rounds)
    assert len(faults_of(given)) == 45
    scope, law = Instrument(parameters(), TICKS), Controller(LAW)
    for i in range(len(rounds)):
        scope.close_loop(law, 10 + 5 * i - 1 - scope.ticks)
        scope.set_faults(parameters(*rounds[: i + 1]))
    scope.close_loop(law, TICKS - scope.ticks)
    expected = simulate(given, LAW).trajectory_sha256
    assert scope.trajectory_sha256() == expected
    scope.take_block()
    scope.reset()
    law.reset()
    scope.close_loop(law, TICKS)
    assert scope.trajectory_sha256() == expected


def test_drives_that_were_recorded_give_the_same_trajectory_again() -> None:
    given = parameters(*ALL)
    run = simulate(given, LAW)
    known = flatten(parameters()) | {"use_sim_time": False}
    changes = [Change(name, value) for name, value in flatten(given).items() if name not in known]
    again = recorded_parameters(known, changes)
    assert again == given
    assert simulate(again, Replay(run.drive)).trajectory_sha256 == run.trajectory_sha256


class Change:
    """A change of a parameter as a recording tells it."""

    def __init__(self, name: str, new: object) -> None:
        self.name, self.new = name, new


def test_what_is_drawn_is_uniform_and_normal_and_of_its_own_in_every_tick() -> None:
    n = 20_000
    even = np.array([uniform(np.uint64(bits(np.uint64(bits(2**62 + 1, k)), 3))) for k in range(n)])
    bell = np.array([normal(np.uint64(bits(1, k)), 3) for k in range(n)])
    # Within five standard errors of the moments.
    assert even.mean() == pytest.approx(0.5, abs=5 / math.sqrt(12 * n))
    assert (even.min() > 0.0, even.max() <= 1.0) == (True, True)
    assert (bell.mean(), bell.std()) == (pytest.approx(0.0, abs=5 / n**0.5), pytest.approx(1.0, abs=5 / (2 * n) ** 0.5))
    for lag in (1, 2, 16, 256):
        assert abs(np.corrcoef(bell[lag:], bell[:-lag])[0, 1]) < 5 / n**0.5
