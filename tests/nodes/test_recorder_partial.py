"""The file that a recording grows in: whose it is, what may stand there, what is left when its writer dies."""

import errno
import logging
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from afm_recorder_node import frames, layout, sink
from afm_recorder_node.complete import complete
from afm_recorder_node.names import claim, numbered
from afm_recorder_node.parameters import RecorderParameters
from afm_recorder_node.partial import InUse, Partial
from afm_recorder_node.readable import readable
from afm_recorder_node.reader import Opened, read_recording, read_signals
from afm_recorder_node.recorder import Recorder
from afm_recorder_node.recording import IncompleteRecording, RecordingError
from afm_recorder_node.repair import repair
from afm_recorder_node.writer import RecordingWriter

HEADER = b"header"


def write(writer: RecordingWriter, first: int, count: int) -> None:
    ticks = np.arange(first, first + count, dtype=np.float64)
    rows = np.outer(ticks, [1.0, 2.0, 3.0])
    writer.channel(layout.DEFLECTION, 2 * first, 1e-6, np.arange(2.0 * first, 2.0 * (first + count)))
    writer.control(
        first, 2e-6, position=rows, reference=0.5 * rows, deflection=ticks, drive=rows, round_trip=np.zeros(count)
    )


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """What a recorder leaves that is killed: 1000 ticks in ten pieces."""
    folder = tmp_path_factory.mktemp("killed")
    code = (
        "import os, signal, sys; sys.path.insert(0, sys.argv[2])\n"
        "from test_recorder_partial import write, RecordingWriter\n"
        "writer = RecordingWriter(sys.argv[1])\n"
        "writer.parameters('afm_sim_node', {'plant.dt': 1e-6})\n"
        "for k in range(10):\n    write(writer, 100 * k, 100)\n    writer.flush()\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    arguments = [sys.executable, "-c", code, str(folder / "run.rrd"), str(Path(__file__).parent)]
    assert subprocess.run(arguments, timeout=60, check=False).returncode == -9
    return (folder / "run.partial.rrd").read_bytes()


@pytest.fixture
def left(killed: bytes, tmp_path: Path) -> Path:
    """A file with that."""
    path = tmp_path / "run.partial.rrd"
    path.write_bytes(killed)
    return path


def ticks(path: Path) -> int:
    """Ticks in a complete recording."""
    return len(read_recording(path).time_ticks)


def rows(recording_path: Path) -> int:
    with pytest.warns(IncompleteRecording):
        recording = read_recording(recording_path)
    assert not recording.complete
    np.testing.assert_allclose(recording.position[:, 0], np.arange(len(recording.time_ticks)), rtol=1e-15)
    return len(recording.time_ticks)


def test_what_a_killed_recorder_left_is_read_to_the_last_flush(left: Path) -> None:
    assert rows(left) == 1000


@pytest.mark.parametrize("tail", [b"", b"\0" * 4096, b"\xff" * 100], ids=["cut", "zeros", "rubbish"])
def test_recording_that_breaks_off_anywhere_is_read_up_to_the_last_whole_piece(left: Path, tail: bytes) -> None:
    whole = left.read_bytes()
    seen = []
    for part in (0.6, 0.8, 0.95):
        left.write_bytes(whole[: int(part * len(whole))] + tail)
        seen.append(rows(left))
    assert seen == sorted(seen) and 0 < seen[0] < seen[-1] <= 1000


def test_repair_makes_a_complete_recording_and_leaves_the_old_file(left: Path, tmp_path: Path) -> None:
    content = left.read_bytes()[:-100]
    left.write_bytes(content)
    out = tmp_path / "repaired.rrd"
    program = [sys.executable, "-m", "afm_recorder_node.repair", str(left), str(out)]
    result = subprocess.run(program, capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr
    recording = read_recording(out)
    assert recording.complete
    assert f"holds {len(recording.time_ticks)} ticks" in result.stdout
    assert 900 <= len(recording.time_ticks) <= 1000
    assert recording.parameters == {"afm_sim_node": {"plant.dt": 1e-6}}
    verify = [Path(sys.executable).with_name("rerun"), "rrd", "verify", out]
    assert subprocess.run(verify, capture_output=True, timeout=60).returncode == 0
    assert left.read_bytes() == content
    again = subprocess.run(program, capture_output=True, text=True, timeout=60)
    assert again.returncode == 1 and "nothing is overwritten" in again.stderr


def test_file_that_is_no_recording_is_not_repaired(tmp_path: Path) -> None:
    (tmp_path / "text.rrd").write_text("hello")
    with pytest.raises(RecordingError, match=r"text\.rrd"):
        repair(tmp_path / "text.rrd", tmp_path / "out.rrd")
    assert not (tmp_path / "out.rrd").exists()


def test_complete_recording_has_large_pieces_only(left: Path, tmp_path: Path) -> None:
    def pieces(path: Path) -> int:
        program = [Path(sys.executable).with_name("rerun"), "rrd", "stats", path]
        text = subprocess.run(program, capture_output=True, text=True, timeout=60).stdout
        (line,) = [line for line in text.splitlines() if line.startswith("num_chunks = ")]
        return int(line.removeprefix("num_chunks = ").replace(" ", ""))

    before = pieces(left)
    complete(left, [tmp_path / "run.rrd"])
    # Six signals of ten pieces each, one after it; a scene and ranges of axes are added.
    assert pieces(tmp_path / "run.rrd") <= before - 40


def test_recording_that_does_not_hold_what_was_written_gets_no_name(left: Path, tmp_path: Path) -> None:
    with pytest.raises(OSError, match="1000 of 1001 rows of /position"):
        complete(left, [tmp_path / "run.rrd"], {"/position": 1001})
    assert [file.name for file in tmp_path.iterdir()] == [left.name]


def test_file_that_another_one_changed_while_it_grew_gets_no_name(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "run.rrd")
    write(writer, 0, 1000)
    writer.flush()
    with writer.partial.open("r+b") as file:
        file.seek(-2000, os.SEEK_END)
        (byte,) = file.read(1)
        file.seek(-2000, os.SEEK_END)
        file.write(bytes([byte ^ 1]))
    with pytest.raises(OSError, match=r"incomplete: .* has been changed"):
        writer.close()
    assert [file.name for file in tmp_path.iterdir()] == ["run.partial.rrd"]


def test_second_writer_of_one_path_is_refused_and_a_third_after_the_first_is_not(tmp_path: Path) -> None:
    first = RecordingWriter(tmp_path / "run.rrd")
    write(first, 0, 10)
    with pytest.raises(InUse, match="another recorder writes"):
        RecordingWriter(tmp_path / "run.rrd")
    first.close()
    assert len(read_recording(tmp_path / "run.rrd").time_ticks) == 10
    with closing(RecordingWriter(tmp_path / "run.rrd")) as third:
        write(third, 0, 20)
    assert third.path == tmp_path / "run-2.rrd"
    assert ticks(third.path) == 20


def test_recorder_that_is_started_again_replaces_no_complete_recording(tmp_path: Path, killed: bytes) -> None:
    path = tmp_path / "run.rrd"
    for count in (30, 20, 10):
        with closing(RecordingWriter(path)) as writer:
            write(writer, 0, count)
    assert [ticks(tmp_path / name) for name in ("run.rrd", "run-2.rrd", "run-3.rrd")] == [30, 20, 10]
    (tmp_path / "run-4.partial.rrd").write_bytes(killed)
    with closing(RecordingWriter(path)) as writer:
        write(writer, 0, 5)
    assert (writer.path, writer.number) == (tmp_path / "run-4.rrd", 4)
    assert writer.set_aside == tmp_path / "run-4.interrupted.rrd"
    assert writer.set_aside.read_bytes() == killed
    assert [ticks(tmp_path / name) for name in ("run.rrd", "run-2.rrd", "run-3.rrd", "run-4.rrd")] == [30, 20, 10, 5]


@pytest.mark.parametrize("name", ["run.rrd", "run.partial.rrd"])
@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda path: path.mkdir(), "folder"),
        (lambda path: path.symlink_to(path.with_name("target")), "symbolic link"),
        (lambda path: path.symlink_to("/dev/null"), "symbolic link"),
        (os.mkfifo, "pipe"),
    ],
    ids=["folder", "link", "link to a device", "pipe"],
)
def test_what_is_no_plain_file_is_neither_followed_nor_replaced(
    tmp_path: Path, name: str, make: Callable[[Path], None], what: str
) -> None:
    make(tmp_path / name)
    before = os.lstat(tmp_path / name)
    with pytest.raises(OSError, match=f"{name}.*{what}"):
        RecordingWriter(tmp_path / "run.rrd")
    assert os.path.samestat(before, os.lstat(tmp_path / name))
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_device_is_not_replaced() -> None:
    with pytest.raises(OSError, match="/dev/null is a device"):
        RecordingWriter("/dev/null")


def cannot(*_: object, **__: object) -> None:
    """As os.link on a file system without links."""
    raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))


@pytest.mark.parametrize("in_place", [False, True])
@pytest.mark.parametrize(
    "make",
    [
        lambda path: path.mkdir(),
        lambda path: path.symlink_to("/etc/passwd"),
        lambda path: path.write_text("another one's"),
    ],
    ids=["folder", "link", "file"],
)
@pytest.mark.parametrize("links", [True, False])
def test_what_appears_under_the_name_while_recording_is_not_replaced(
    tmp_path: Path, make: Callable[[Path], None], in_place: bool, links: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if in_place:
        monkeypatch.setattr(sink, "_COPIED_UP_TO", 0)
    if not links:
        monkeypatch.setattr(os, "link", cannot)
    writer = RecordingWriter(tmp_path / "run.rrd")
    write(writer, 0, 10)
    make(tmp_path / "run.rrd")
    before = os.lstat(tmp_path / "run.rrd")
    assert writer.close() == writer.path == tmp_path / "run-2.rrd"
    assert os.lstat(tmp_path / "run.rrd") == before
    assert ticks(tmp_path / "run-2.rrd") == 10
    assert sorted(file.name for file in tmp_path.iterdir()) == ["run-2.rrd", "run.rrd"]


def test_one_name_is_given_once_however_many_want_it(tmp_path: Path) -> None:
    sources = [tmp_path / f"{n}.tmp" for n in range(20)]
    for source in sources:
        source.write_text(source.name)
    with ThreadPoolExecutor(10) as pool:
        names = list(pool.map(lambda source: claim(source, numbered(tmp_path / "run.rrd")), sources))
    assert len(set(names)) == len(sources)
    assert [name.read_text() for name in names] == [source.name for source in sources]


def test_name_kept_for_recordings_under_way_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="kept for recordings under way"):
        RecordingWriter(tmp_path / "run.partial.rrd")


def test_folder_that_cannot_be_written_is_told_in_one_sentence() -> None:
    code = (
        "import os, sys, pathlib\nfrom afm_recorder_node.partial import Partial\nos.setuid(65534)\n"
        "try:\n    Partial(pathlib.Path(sys.argv[1]), b'')\nexcept OSError as error:\n    print(error)\n"
    )
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        Path(folder).chmod(0o555)
        program = [sys.executable, "-c", code, str(Path(folder) / "run.rrd")]
        result = subprocess.run(program, capture_output=True, text=True, timeout=60)
    (line,) = result.stdout.splitlines() or [result.stderr]
    assert "Permission denied" in line and "run.partial.rrd" in line


@pytest.mark.parametrize("mask", [0o022, 0o027, 0o077])
def test_recording_has_the_mode_that_the_umask_gives(tmp_path: Path, mask: int) -> None:
    path = tmp_path / "run.rrd"
    before = os.umask(mask)
    try:
        with closing(RecordingWriter(path)) as writer:
            write(writer, 0, 10)
            assert writer.partial.stat().st_mode & 0o777 == 0o666 & ~mask
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o666 & ~mask


def test_write_that_fails_is_made_up_for_and_the_file_is_whole_in_between(tmp_path: Path) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    partial = Partial(tmp_path / "run.rrd", HEADER)
    assert partial.write(b"a" * 100)
    resource.setrlimit(resource.RLIMIT_FSIZE, (150, limits[1]))
    try:
        assert not partial.write(b"b" * 100)
        assert "File too large" in partial.problem
        assert partial.path.read_bytes() == HEADER + b"a" * 100
        assert not partial.write(b"c" * 10)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert partial.write(b"")
    assert partial.path.read_bytes() == HEADER + b"a" * 100 + b"b" * 100 + b"c" * 10
    partial.discard()


def test_recording_that_grows_while_it_is_read_is_read_up_to_where_it_was(killed: bytes, tmp_path: Path) -> None:
    name = layout.POSITION.entity.strip("/")
    partial = Partial(tmp_path / "run.rrd", killed)
    try:
        with readable(partial.path) as (file, extent):
            assert partial.write(killed[frames.HEADER : frames.HEADER + 50])  # the begin of a message
            assert len(read_signals(Opened("run", file, extent.complete), [name])[name].values) == 1000
    finally:
        partial.release()


def test_recording_of_a_dead_recorder_is_read_where_it_is_and_can_be_set_aside_meanwhile(left: Path) -> None:
    with readable(left) as (file, _):
        assert file == left  # a copy of a long one would fill the disk
        partial = Partial(left.with_name("run.rrd"), HEADER)
        assert partial.set_aside is not None
        partial.discard()


def test_rows_that_come_while_nothing_can_be_written_are_counted_and_told_as_an_event(tmp_path: Path) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    writer = RecordingWriter(tmp_path / "run.rrd")
    write(writer, 0, 1000)
    writer.flush()
    resource.setrlimit(resource.RLIMIT_FSIZE, (writer.partial.stat().st_size, limits[1]))
    try:
        write(writer, 1000, 100)  # kept: it is there when writing fails
        writer.flush()
        for k in range(11, 20):
            write(writer, 100 * k, 100)
            writer.flush()
        assert writer.unwritten["/position"] == 900
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    writer.flush()
    write(writer, 2000, 100)
    writer.close()
    recording = read_recording(tmp_path / "run.rrd")
    ticks = np.rint(recording.time_ticks / 2e-6)
    assert np.array_equal(ticks, [*range(1100), *range(2000, 2100)])
    ((at, text),) = recording.events
    assert at == pytest.approx(1100 * 2e-6, abs=1e-12)
    assert text.startswith("900 ticks and 1800 samples a channel are missing from 0.0022 s to 0.003999 s")
    assert "File too large" in text


def test_recording_without_room_for_a_copy_is_finished_in_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("afm_recorder_node.complete._free", lambda folder: 1000)
    with closing(RecordingWriter(tmp_path / "run.rrd")) as writer:
        for k in range(3):
            write(writer, 100 * k, 100)
            writer.flush()
    assert [file.name for file in tmp_path.iterdir()] == ["run.rrd"]
    recording = read_recording(tmp_path / "run.rrd")
    assert recording.complete and len(recording.time_ticks) == 300


def take_block(recorder: Recorder, first: int) -> None:
    for channel in layout.CHANNELS:
        recorder.channel(channel, 2 * first, 1e-6, np.zeros(20), 1.0)
    columns = {"position": np.zeros((10, 3)), "reference": np.zeros((10, 3)), "drive": np.zeros((10, 3))}
    recorder.control(first, 2e-6, 0, columns | {"deflection": np.zeros(10), "round_trip": np.zeros(10)})


def another(path: Path) -> None:
    """A complete recording of another recorder."""
    with closing(RecordingWriter(path)) as writer:
        write(writer, 0, 8510)


@pytest.mark.parametrize(
    "make", [RecordingWriter, lambda path: path.mkdir(), another], ids=["in use", "a folder", "another one's"]
)
def test_run_after_a_reset_takes_the_next_name_that_is_free(tmp_path: Path, make: Callable[[Path], object]) -> None:
    recorder = Recorder(RecorderParameters(path=str(tmp_path / "run.rrd")), logging.getLogger("recorder"))
    recorder.cantilever_height(0.0)
    take_block(recorder, 0)
    take_block(recorder, 10)
    taken = make(tmp_path / "run-2.rrd")
    take_block(recorder, 0)
    assert recorder.counts().path == str(tmp_path / "run-3.rrd")
    recorder.close()
    assert ticks(tmp_path / "run.rrd") == 20
    assert ticks(tmp_path / "run-3.rrd") == 10
    if make is another:
        assert ticks(tmp_path / "run-2.rrd") == 8510
    if isinstance(taken, RecordingWriter):
        taken.close()


def test_recorder_that_is_started_again_says_where_it_records(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    parameters = RecorderParameters(path=str(tmp_path / "run.rrd"))
    for name, count in (("run.rrd", 2), ("run-2.rrd", 1)):
        recorder = Recorder(parameters, logging.getLogger("recorder"))
        recorder.cantilever_height(0.0)
        for block in range(count):
            take_block(recorder, 10 * block)
        assert recorder.counts().path == str(tmp_path / name)
        recorder.close()
    assert [ticks(tmp_path / name) for name in ("run.rrd", "run-2.rrd")] == [20, 10]
    (said,) = [record.message for record in caplog.records if "never replaced" in record.message]
    assert f"{tmp_path / 'run-2.rrd'}" in said
