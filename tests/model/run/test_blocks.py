"""Blocks handed on in pieces are those handed on at once: same ticks, same order, same hash, nothing kept back."""

import numpy as np

from .hand import Bench


def ticked(ticks: int, *, in_pieces: bool, pieces_a_tick: int = 0, block_ticks: int = 4) -> Bench:
    """A run in real time that was ticked so often, with so many pieces of work done behind each tick."""
    bench = Bench("realtime", block_ticks=block_ticks, in_pieces=in_pieces)
    bench.at(0)
    for k in range(1, ticks + 1):
        assert bench.at(k)
        for _ in range(pieces_a_tick):
            bench.run.blocks.do_one()
    assert bench.ticks == ticks
    return bench


def test_block_that_is_full_is_handed_on_by_pieces_of_work_and_not_by_the_tick() -> None:
    bench = ticked(8, in_pieces=True)
    assert bench.blocks == []
    done = 0
    while bench.run.blocks.do_one():
        done += 1
    assert done > 2
    assert [(block.first_tick, len(block.drives)) for block in bench.blocks] == [(0, 4), (4, 4)]


def test_blocks_in_pieces_hold_what_blocks_at_once_hold() -> None:
    pieces, whole = ticked(30, in_pieces=True, pieces_a_tick=1), ticked(30, in_pieces=False)
    for bench in (pieces, whole):
        bench.run.flush()
    assert [block.first_tick for block in pieces.blocks] == [block.first_tick for block in whole.blocks]
    for one, other in zip(pieces.blocks, whole.blocks, strict=True):
        for name in ("measurements", "drives", "samples", "states"):
            assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
    np.testing.assert_array_equal(pieces.round_trips, whole.round_trips)
    assert pieces.run.delays().lateness == whole.run.delays().lateness


def test_hash_counts_blocks_whose_work_is_not_done() -> None:
    undone, whole = ticked(10, in_pieces=True), ticked(10, in_pieces=False)
    assert undone.blocks == []
    expected = whole.run.instrument.trajectory_sha256()
    assert undone.run.instrument.trajectory_sha256() == expected
    undone.run.flush()
    assert undone.run.instrument.trajectory_sha256() == expected


def test_run_that_leaves_no_time_hands_its_blocks_on_all_the_same() -> None:
    bench = ticked(400, in_pieces=True)
    handed = sum(len(block.drives) for block in bench.blocks)
    assert 300 < handed < 400
    assert [block.first_tick for block in bench.blocks] == list(range(0, handed, 4))


def test_reset_and_end_wait_for_the_work_that_is_left() -> None:
    bench = ticked(9, in_pieces=True)
    bench.run.reset()
    assert [len(block.drives) for block in bench.blocks] == [4, 4, 1]
    over = Bench("realtime", ticks=6, block_ticks=4, in_pieces=True)
    for k in range(7):
        over.at(k)
    assert (over.ends, [len(block.drives) for block in over.blocks]) == (1, [4, 2])
