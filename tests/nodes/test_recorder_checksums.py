"""A recording that has changed since it was written is told, whichever byte it is."""

import random
import shutil
import warnings
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from recorded import Run

from afm_bringup.replay_command import main as replay
from afm_recorder_node import layout, sink
from afm_recorder_node.frames import walk
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import (
    DamagedRecording,
    IncompleteRecording,
    Recording,
    RecordingError,
    UncheckedRecording,
)
from afm_recorder_node.repair import repair
from afm_recorder_node.writer import RecordingWriter

TICKS = 3000


def made(path: Path, close: bool = True) -> Path:
    """A recording with all that a reader reads; or what a recorder leaves that is killed."""
    run = Run(TICKS)
    writer = RecordingWriter(path)
    writer.parameters("afm_sim_node", {"plant.kind": "compliant", "plant.dt": 1e-6})
    for start in range(0, TICKS, 500):
        run.write(writer, start, start + 500)
        writer.event(2_000 * start, f"tick {start}")
        writer.flush()
    writer.parameter_change(60_000, "afm_controller_node", "law.alpha", 20.0, 5.0)
    writer.score(60_000, {"ticks": TICKS, "rms": [1e-9, 2e-9, 3e-9]})
    if close:
        writer.close()
        return path
    writer.flush()
    return shutil.copy(writer.partial, path)


def in_place(path: Path) -> Path:
    """A recording that was too large for a copy, and keeps the checksum of each flush."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sink, "_COPIED_UP_TO", 0)
        return made(path)


def killed(path: Path) -> Path:
    """What a killed recorder leaves."""
    return made(path, close=False)


def read(path: Path) -> tuple[Recording, set[type[Warning]]]:
    """The recording, and what its reader says about it."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        return read_recording(path), {warning.category for warning in said}


def same(one: Recording, other: Recording) -> bool:
    try:
        for field in fields(Recording):
            if field.name != "channels":
                np.testing.assert_equal(getattr(one, field.name), getattr(other, field.name))
        for name, channel in other.channels.items():
            np.testing.assert_equal(one.channels[name].values, channel.values)
    except AssertionError:
        return False
    return True


def left_of(one: Recording, other: Recording) -> bool:
    """Whether `one` is the begin of the other, or has gaps where the other has numbers."""
    return all(
        np.array_equal(np.where(np.isnan(part), whole[: len(part)], part), whole[: len(part)])
        for part, whole in ((one.position, other.position), (one.deflection, other.deflection))
    )


def numbers(recording: Recording) -> int:
    """How many numbers it holds."""
    ticks = (recording.position, recording.reference, recording.error, recording.drive, recording.round_trip)
    return sum(int(np.isfinite(values).sum()) for values in ticks) + sum(
        len(channel.values) for channel in recording.channels.values()
    )


@pytest.mark.parametrize("kind", [made, in_place, killed])
def test_no_changed_byte_gives_other_numbers_without_a_word(tmp_path: Path, kind: Callable[[Path], Path]) -> None:
    whole, said_before = read(kind(tmp_path / "run.rrd"))
    content = (tmp_path / "run.rrd").read_bytes()
    path, rng, told = tmp_path / "changed.rrd", random.Random(1), 0
    places = [*rng.sample(range(len(content)), 200), *range(0, 60), *range(len(content) - 40, len(content))]
    for place in places:
        changed = bytearray(content)
        changed[place] ^= 1 << rng.randrange(8)
        path.write_bytes(changed)
        try:
            recording, said = read(path)
        except RecordingError:
            told += 1
            continue
        if said - said_before:
            told += 1
            assert left_of(recording, whole), place
        else:
            # Only what is behind the last whole flush of a killed recorder may be missing without another word.
            assert same(recording, whole) or (kind is killed and left_of(recording, whole)), place
    assert told > 0.9 * len(places)


def test_repair_leaves_out_what_was_changed_and_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = in_place(tmp_path / "run.rrd")
    whole, _ = read(path)
    with open(path, "r+b") as file:
        chunks = sorted(walk(file.fileno()), key=lambda message: message.start - message.end)
        file.seek(chunks[0].start + 600)
        file.write(b"another value")
    with pytest.raises(DamagedRecording, match="repair"):
        read_recording(path)
    assert replay([str(path)]) == 1
    assert "is damaged" in capsys.readouterr().err
    _, note = repair(path, tmp_path / "repaired.rrd")
    repaired, said = read(tmp_path / "repaired.rrd")
    assert not said
    assert note in [text for _, text in repaired.events]
    assert left_of(repaired, whole)
    assert 0 < numbers(repaired) < numbers(whole)


def test_recordings_without_checksums_are_read_with_a_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = made(tmp_path / "run.rrd").read_bytes()
    (tmp_path / "older.rrd").write_bytes(content.replace(b"AFMCRC32", b"AFMCRC31"))
    _, said = read(tmp_path / "older.rrd")
    assert said == {UncheckedRecording}


def test_recording_that_breaks_off_is_read_up_to_the_last_checksums(tmp_path: Path) -> None:
    content = killed(tmp_path / "run.rrd").read_bytes()
    whole, _ = read(tmp_path / "run.rrd")
    (tmp_path / "cut.rrd").write_bytes(content[: 2 * len(content) // 3])
    cut, said = read(tmp_path / "cut.rrd")
    assert said == {IncompleteRecording}
    assert 0 < len(cut.time_ticks) < len(whole.time_ticks)
    assert len(cut.time_ticks) % 500 == 0
    assert left_of(cut, whole)
    assert not np.isnan(cut.channels[layout.DEFLECTION.name].values).any()
