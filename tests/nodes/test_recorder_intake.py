"""Blocks of several topics come out once, in order, in their run."""

from hypothesis import given
from hypothesis import strategies as st

from afm_recorder_node.intake import HOLD_LIMIT, Intake


class Tape:
    """Writes of an intake, one list for each run."""

    def __init__(self) -> None:
        self.runs: list[list[tuple[str, int]]] = [[]]
        self.intake = Intake("ab", lambda: self.runs.append([]))

    def put(self, stream: str, first: int, count: int = 10) -> None:
        self.intake.put(stream, first, count, lambda: self.runs[-1].append((stream, first)))


def test_blocks_wait_until_the_intake_is_open() -> None:
    tape = Tape()
    tape.put("a", 0)
    assert tape.runs == [[]]
    tape.intake.open()
    tape.put("a", 10)
    assert tape.runs == [[("a", 0), ("a", 10)]]


def test_memory_stays_flat_if_the_intake_is_never_opened() -> None:
    tape = Tape()
    for k in range(HOLD_LIMIT + 1):
        tape.put("a", 10 * k)
    assert len(tape.runs[0]) == HOLD_LIMIT + 1


def test_gaps_between_blocks_are_counted_and_a_late_start_is_none() -> None:
    tape = Tape()
    tape.intake.open()
    for first in (50, 60, 90):
        tape.put("a", first)
    stream = tape.intake.streams["a"]
    assert (stream.received, stream.lost, stream.expected) == (30, 20, 100)


def test_a_block_out_of_place_is_dropped_when_its_stream_goes_on_as_before() -> None:
    tape = Tape()
    tape.intake.open()
    for first in (0, 10, 20):
        tape.put("a", first)
        tape.put("b", first)
    tape.put("a", 0, count=2)  # somebody else
    tape.put("a", 30)
    tape.put("b", 30)
    assert tape.intake.strays == 1
    assert tape.runs == [[(name, first) for first in (0, 10, 20, 30) for name in "ab"]]
    stream = tape.intake.streams["a"]
    assert (stream.received, stream.lost, stream.expected) == (40, 0, 40)


@st.composite
def interleaved(draw: st.DrawFn) -> list[tuple[str, int, int]]:
    """Blocks (stream, run, first) of two streams over up to four runs, in any order that keeps each stream's own."""
    lengths = draw(st.lists(st.tuples(st.integers(1, 4), st.integers(1, 4)), min_size=1, max_size=4))
    queues = {
        name: [(name, run, 10 * k) for run, pair in enumerate(lengths) for k in range(pair[column])]
        for column, name in enumerate("ab")
    }
    first = draw(st.permutations("ab"))
    # Both streams have begun before any of them can begin again.
    blocks = [queues[name].pop(0) for name in first]
    while queues["a"] or queues["b"]:
        name = draw(st.sampled_from([name for name in "ab" if queues[name]]))
        blocks.append(queues[name].pop(0))
    return blocks


@given(blocks=interleaved())
def test_each_block_is_written_once_and_in_its_run(blocks: list[tuple[str, int, int]]) -> None:
    tape = Tape()
    tape.intake.open()
    for stream, _, first in blocks:
        tape.put(stream, first)
    tape.intake.finish()
    assert len(tape.runs) == 1 + max(run for _, run, _ in blocks)
    for run, written in enumerate(tape.runs):
        for name in "ab":
            assert [b for b in written if b[0] == name] == [(s, f) for s, r, f in blocks if (s, r) == (name, run)]
