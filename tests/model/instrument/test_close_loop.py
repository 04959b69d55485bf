"""Claims about the loop in one compiled call: the bytes of the loop tick by tick; and about the delay of the drive."""

from types import SimpleNamespace

import numpy as np
import pytest

from afm_model import DivergenceError, DriveError, Instrument
from afm_model.compiled.records import size
from afm_model.instrument.tick import DRAW_TICKS
from afm_model.parameters import Value
from afm_model.parts.header import LawHeader

from .. import session
from ..tables import numbers

NOISY: dict[str, Value] = {
    "detector.noise": 2e-3,
    "detector.position_noise": 1e-11,
    "detector.adc_bits": 16,
    "piezo.dac_bits": 16,
    "piezo.limit": 150.0,
    "plant.seed": 5,
    "plant.control_period": 4e-6,
    "score.start": 1e-3,
}
CASES: list[dict[str, Value]] = [
    {},
    NOISY,
    NOISY | {"plant.delay_ticks": 3},
    {"plant.kind": "paper", "plant.z": "uniform", "plant.delay_ticks": 1},
]


def both(values: dict[str, Value], kind: str, block_ticks: int, ticks: int, at_once: int) -> tuple[Instrument, ...]:
    """The same run tick by tick and in pieces of `at_once` ticks; their blocks must be the same."""
    law = session.controller({"law.kind": kind})
    one, many = session.instrument(values, block_ticks), session.instrument(values, block_ticks)
    while one.ticks < ticks:
        first = one.ticks
        while one.ticks < ticks and not one.block_full:
            one.tick(law.answer(one.measurement))
        while many.ticks < ticks and not many.block_full:
            many.close_loop(law, min(at_once, ticks - many.ticks))
        a, b = one.take_block(), many.take_block()
        assert a.first_tick == b.first_tick == first
        np.testing.assert_array_equal(numbers(a.measurements), numbers(b.measurements))
        np.testing.assert_array_equal(a.drives, b.drives)
        np.testing.assert_array_equal(a.samples, b.samples)
    return one, many


@pytest.mark.parametrize("values", CASES)
@pytest.mark.parametrize("kind", ["open_loop", "sgn", "tanh"])
def test_compiled_loop_gives_the_bytes_of_the_loop_tick_by_tick(values, kind):
    one, many = both(values, kind, block_ticks=300, ticks=1000, at_once=1000)
    assert one.trajectory_sha256() == many.trajectory_sha256()
    np.testing.assert_array_equal(one.measurement, many.measurement)
    np.testing.assert_array_equal(one.score().rms, many.score().rms)


@pytest.mark.parametrize("block_ticks", [1, DRAW_TICKS - 1, DRAW_TICKS, 2 * DRAW_TICKS + 1])
@pytest.mark.parametrize("at_once", [1, 7, 10_000])
@pytest.mark.parametrize("values", [{}, NOISY | {"plant.delay_ticks": 2}])
def test_compiled_loop_does_not_depend_on_where_it_is_interrupted(values, block_ticks, at_once):
    one, many = both(values, "tanh", block_ticks, ticks=600, at_once=at_once)
    assert one.trajectory_sha256() == many.trajectory_sha256()


def test_compiled_loop_stops_at_the_end_of_the_block_and_does_not_start_in_a_full_one():
    scope = session.instrument({}, 50)
    law = session.controller({})
    scope.close_loop(law, 80)
    assert scope.ticks == 50 and scope.block_full
    with pytest.raises(RuntimeError, match="the block is full"):
        scope.close_loop(law, 1)
    scope.skip_block()
    scope.close_loop(law, 0)
    assert scope.ticks == 50


def test_skipped_blocks_still_count_in_the_hash():
    skipped, taken = session.instrument({}, 50), session.instrument({}, 50)
    for scope, leave in ((skipped, skipped.skip_block), (taken, taken.take_block)):
        for _ in range(3):
            scope.close_loop(session.controller({}), 50)
            leave()
    assert skipped.trajectory_sha256() == taken.trajectory_sha256()


@pytest.mark.parametrize("error", [DriveError, DivergenceError])
def test_compiled_loop_ends_with_the_sentence_and_at_the_tick_of_the_loop_tick_by_tick(error):
    law = session.controller({})
    # No parameter makes our law answer so: spoil its constants.
    law.block[size(LawHeader) :] *= np.nan if error is DriveError else -1e3
    ends = []
    for step in (
        lambda scope: scope.tick(law.answer(scope.measurement)),
        lambda scope: scope.close_loop(law, 5000),
    ):
        scope = session.instrument({}, 5000)
        with pytest.raises(error) as caught:
            [step(scope) for _ in range(5001)]
        ends.append((scope.ticks, str(caught.value), scope.trajectory_sha256()))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("delay", [0, 1, 5])
def test_drive_applied_at_tick_k_answers_measurement_k_minus_delay(delay):
    scope = session.instrument({"plant.delay_ticks": delay}, 100)
    rest = scope.drive
    law = session.controller({})
    answers = []
    for _ in range(100):
        answers.append(law.answer(scope.measurement).copy())
        scope.tick(answers[-1])
    block = scope.take_block()
    np.testing.assert_array_equal(block.drives[:delay], np.tile(rest, (delay, 1)))
    np.testing.assert_array_equal(block.drives[delay:], answers[: 100 - delay])


def test_delay_is_a_controller_that_answers_late():
    scope = session.instrument({"plant.delay_ticks": 4, "plant.control_period": 4e-6}, 400)
    twin = session.instrument({"plant.control_period": 4e-6}, 400)
    law = session.controller({})
    line = [twin.drive for _ in range(4)]
    late = SimpleNamespace(answer=lambda y: (line.append(law.answer(y).copy()), line.pop(0))[1])
    for _ in range(400):
        twin.tick(late.answer(twin.measurement))
    scope.close_loop(law, 400)
    assert scope.trajectory_sha256() == twin.trajectory_sha256()


def test_reset_empties_the_delay_line():
    scope = session.instrument({"plant.delay_ticks": 4}, 200)
    law = session.controller({})
    digests = []
    for _ in range(2):
        scope.close_loop(law, 101)
        digests.append(scope.trajectory_sha256())
        scope.reset()
    assert digests[0] == digests[1]


def test_nan_is_refused_at_once_in_spite_of_a_delay():
    scope = session.instrument({"plant.delay_ticks": 4})
    with pytest.raises(DriveError, match="y = nan V"):
        scope.tick(np.array([0.0, np.nan, 0.0]))
    assert scope.ticks == 0
