"""A record that has changed since it was written, or breaks off, is reported; what is whole of it can be copied."""

import random
import sys
import warnings
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import recorded
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC
from recorded import Run, event, line_message, lines_of, parameters, status
from rosbags.highlevel import AnyReader

from afm_bringup.replay_command import main as replay
from afm_recorder_node.reader import read_recording
from afm_recorder_node.record import RunRecord, open_record
from afm_recorder_node.recording import DamagedRecording, IncompleteRecording, Recording, RecordingError
from afm_recorder_node.repair import main, repair

TICKS, BLOCK = 900, 150


def made(path: Path, close: bool = True) -> Path:
    """A record with all that a reader reads, in seven chunks; or what a recorder leaves that is killed."""
    run = Run(TICKS)
    writer = recorded.begin(path, [status(0.0, 1), parameters("afm_sim_node", {"cantilever.a": recorded.HEIGHT})])
    for start in range(0, TICKS, BLOCK):
        recorded.put(writer, [*run.block(start, start + BLOCK), event(start * 2e-6, f"tick {start}")])
    recorded.put(writer, [parameters("afm_controller_node", {"law.alpha": 5.0}, 1e-3), line_message(lines_of()[0])])
    if close:
        writer.close({"missing": ""})
    else:
        writer.file.release()
    return path


def read(path: Path) -> tuple[Recording, set[type[Warning]]]:
    """The recording, and what its reader says about it."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        return read_recording(path), {warning.category for warning in said}


def same(one: Recording, other: Recording) -> bool:
    try:
        for field in fields(Recording):
            if field.name not in ("images", "channels"):
                np.testing.assert_equal(getattr(one, field.name), getattr(other, field.name))
        np.testing.assert_equal([each.data for each in one.images], [each.data for each in other.images])
        assert one.channels.keys() == other.channels.keys()
        for name, channel in other.channels.items():
            np.testing.assert_equal(vars(one.channels[name]), vars(channel))
    except AssertionError:
        return False
    return True


def begins(one: Recording, other: Recording) -> bool:
    """Whether `one` is the begin of the other."""
    known = all(other.parameters.get(node) == values for node, values in one.parameters.items())
    return known and all(
        np.array_equal(part, whole[: len(part)])
        for part, whole in ((one.position, other.position), (one.deflection, other.deflection))
    )


@pytest.mark.parametrize("close", [True, False], ids=["whole", "of a killed recorder"])
def test_no_changed_bit_gives_other_contents_without_a_word(tmp_path: Path, close: bool) -> None:
    whole, said_before = read(made(tmp_path / "run.mcap", close))
    content = (tmp_path / "run.mcap").read_bytes()
    path, rng, reported = tmp_path / "changed.mcap", random.Random(1), 0
    heads = [chunk.begin + k for chunk in open_record(path.with_name("run.mcap"))._chunks[2:4] for k in range(36)]
    ends = [*range(0, 180, 2), *range(len(content) - 20, len(content))]
    places = [*rng.sample(range(len(content)), 58), *heads, *ends]
    for place in places:
        changed = bytearray(content)
        changed[place] ^= 1 << rng.randrange(8)
        path.write_bytes(changed)
        try:
            recording, said = read(path)
        except RecordingError:
            reported += 1
            continue
        # A record without an end may break off anywhere: then it is read up to its last whole chunk, which is said.
        assert same(recording, whole) or (said == {IncompleteRecording} and begins(recording, whole)), place
        reported += said != said_before
    assert reported > (0.95 if close else 0.5) * len(places)


def test_record_cut_anywhere_is_read_up_to_its_last_whole_chunk(tmp_path: Path) -> None:
    whole, _ = read(made(tmp_path / "run.mcap"))
    content, path, rng = (tmp_path / "run.mcap").read_bytes(), tmp_path / "cut.mcap", random.Random(2)
    # Some where the byte at the place of a footer looks like one.
    footer = 9 + 20 + len(MCAP0_MAGIC)
    assert content[-footer] == Opcode.FOOTER
    like_it = [size for size in range(footer, len(content)) if content[size - footer] == Opcode.FOOTER]
    seen = []
    for size in sorted({*rng.sample(range(len(content)), 40), *rng.sample(like_it, 20)}):
        path.write_bytes(content[:size])
        try:
            cut, said = read(path)
        except RecordingError:
            assert not seen  # no chunk stands in it yet
            continue
        assert said == {IncompleteRecording} and not cut.complete and begins(cut, whole)
        assert len(cut.time_samples) == 2 * len(cut.time_ticks) and len(cut.time_ticks) % BLOCK == 0
        seen.append(len(cut.time_ticks))
    assert seen == sorted(seen) and {*seen} >= {BLOCK, TICKS}


@pytest.mark.parametrize("tail", [b"\0" * 4096, b"\xff" * 100], ids=["zeros", "rubbish"])
def test_what_does_not_belong_to_a_record_at_its_end_is_reported(tmp_path: Path, tail: bytes) -> None:
    path = made(tmp_path / "run.mcap", close=False)
    path.write_bytes(path.read_bytes() + tail)
    with pytest.raises(DamagedRecording, match="repair"):
        read_recording(path)
    repair(path, tmp_path / "repaired.mcap")
    assert len(read(tmp_path / "repaired.mcap")[0].time_ticks) == TICKS


def test_repair_leaves_out_a_changed_chunk_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = made(tmp_path / "run.mcap")
    whole, _ = read(path)
    third = sorted(open_record(path)._chunks, key=lambda place: place.begin)[3]
    content = bytearray(path.read_bytes())
    content[(third.begin + third.end) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(DamagedRecording, match="repair"):
        read_recording(path)
    assert replay([str(path)]) == 1
    assert "is damaged" in capsys.readouterr().err
    monkeypatch.setattr(sys, "argv", ["repair", str(path), str(tmp_path / "repaired")])
    assert main() == 0
    assert "are left out" in capsys.readouterr().err
    repaired, said = read(tmp_path / "repaired.mcap")
    assert said == {IncompleteRecording} and "bytes of the recording were damaged" in repaired.missing
    kept = np.isin(whole.time_ticks, repaired.time_ticks)
    assert np.count_nonzero(~kept) == BLOCK and not kept[2 * BLOCK : 3 * BLOCK].any()
    assert np.array_equal(repaired.drive, whole.drive[kept]) and repaired.parameters == whole.parameters
    assert path.read_bytes() == content
    assert main() == 1
    assert "nothing is overwritten" in capsys.readouterr().err


def test_repaired_record_of_a_killed_recorder_is_read_by_programs_of_others(tmp_path: Path) -> None:
    path = made(tmp_path / "run.mcap", close=False)
    content = path.read_bytes()[:-100]
    path.write_bytes(content)
    count, left_out = repair(path, tmp_path / "repaired.mcap")
    assert not left_out and path.read_bytes() == content
    repaired, _ = read(tmp_path / "repaired.mcap")
    assert not repaired.complete and "it has no end" in repaired.missing and len(repaired.time_ticks) == TICKS
    with (tmp_path / "repaired.mcap").open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == count
    with AnyReader([tmp_path / "repaired.mcap"]) as bag:
        assert bag.message_count == count


def test_record_without_a_message_says_of_which_run_it_is(tmp_path: Path) -> None:
    writer = recorded.begin(tmp_path / "run.mcap", [], {"run_id": "7"})
    assert open_record(writer.file.path).about["run_id"] == "7"
    recording, said = read(writer.file.path)
    assert said == {IncompleteRecording} and not recording.complete and len(recording.time_ticks) == 0
    writer.file.discard()


def test_growing_record_is_followed_message_by_message(tmp_path: Path) -> None:
    run, writer = Run(300), recorded.begin(tmp_path / "run.mcap", [status(0.0, 1)])
    record = RunRecord(writer.file.path)
    assert [entry.topic for entry in record.more()] == ["status"]
    for start in (0, 100, 200):
        assert list(record.more()) == []
        recorded.put(writer, run.block(start, start + 100))
        traces = [entry.message for entry in record.more() if entry.topic == "control_trace"]
        assert [trace.first_sequence for trace in traces] == [start]
    writer.close({"missing": ""})
    assert list(record.more()) == [] and record.end == {"missing": ""}


@pytest.mark.parametrize(
    ("name", "content"),
    [("absent.mcap", None), ("empty.mcap", b""), ("text.mcap", b"hello"), ("head.mcap", b"\x89MCAP")],
)
def test_file_that_is_no_recording_is_named_and_not_repaired(tmp_path: Path, name: str, content: bytes | None) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    for attempt in (read_recording, lambda path: repair(path, tmp_path / "out.mcap")):
        with pytest.raises(RecordingError, match=f"{name} is no readable recording"):
            attempt(path)
    assert not (tmp_path / "out.mcap").exists()
