"""The file that a record grows in: whose it is, what may stand there, what happens when it cannot be written."""

import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest

from afm_recorder_node.growing import GrowingFile, InUse, grows


@contextmanager
def at_most(size: int) -> Iterator[None]:
    """No file may grow beyond a size."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_second_recorder_on_a_path_is_refused_and_one_after_it_takes_the_next_name(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    first = GrowingFile(path)
    assert first.write(b"first") and grows(path)
    with pytest.raises(InUse, match="another recorder writes"):
        GrowingFile(path)
    first.finish()
    assert not grows(path)
    second = GrowingFile(path)
    assert (second.path, second.number) == (tmp_path / "run-2.mcap", 2)
    second.discard()
    assert path.read_bytes() == b"first" and [each.name for each in tmp_path.iterdir()] == ["run.mcap"]


def test_reader_that_looks_whether_a_file_grows_is_no_recorder(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(b"of a recorder that was killed")
    with ThreadPoolExecutor(1) as pool:
        looks = pool.submit(lambda: [grows(path) for _ in range(2000)])
        while not looks.done():
            GrowingFile(path).discard()
    assert not any(looks.result())


def test_name_whose_view_is_taken_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "run.rrd").write_text("another one's")
    (tmp_path / "run-2.rrd").symlink_to("nowhere")
    file = GrowingFile(tmp_path / "run.mcap", also=".rrd")
    assert file.path == tmp_path / "run-3.mcap"
    file.discard()


def test_one_name_is_given_once_however_many_want_it(tmp_path: Path) -> None:
    def make(number: int) -> GrowingFile | None:
        try:
            return GrowingFile(tmp_path / "run.mcap")
        except InUse:
            return None

    with ThreadPoolExecutor(10) as pool:
        files = [file for file in pool.map(make, range(50)) if file is not None]
    assert len({file.path for file in files}) == len(files) == len(list(tmp_path.iterdir()))
    for file in files:
        file.release()


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
def test_what_is_no_plain_file_is_not_followed_and_not_replaced(
    tmp_path: Path, make: Callable[[Path], None], what: str
) -> None:
    make(tmp_path / "run.mcap")
    before = os.lstat(tmp_path / "run.mcap")
    with pytest.raises(OSError, match=f"run.mcap is a .*{what}"):
        GrowingFile(tmp_path / "run.mcap")
    assert os.path.samestat(before, os.lstat(tmp_path / "run.mcap"))
    assert [each.name for each in tmp_path.iterdir()] == ["run.mcap"]


def test_device_is_not_replaced() -> None:
    with pytest.raises(OSError, match="/dev/null is a device"):
        GrowingFile(Path("/dev/null"))


def test_folder_that_cannot_be_written_is_named_in_one_sentence() -> None:
    code = (
        "import os, sys, pathlib\nfrom afm_recorder_node.growing import GrowingFile\nos.setuid(65534)\n"
        "try:\n    GrowingFile(pathlib.Path(sys.argv[1]))\nexcept OSError as error:\n    print(error)\n"
    )
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        Path(folder).chmod(0o555)
        program = [sys.executable, "-c", code, str(Path(folder) / "run.mcap")]
        result = subprocess.run(program, capture_output=True, text=True, timeout=60)
    (line,) = result.stdout.splitlines() or [result.stderr]
    assert "Permission denied" in line and "run.mcap" in line


@pytest.mark.parametrize("mask", [0o022, 0o027, 0o077])
def test_file_has_the_mode_that_the_umask_gives(tmp_path: Path, mask: int) -> None:
    before = os.umask(mask)
    try:
        file = GrowingFile(tmp_path / "run.mcap")
    finally:
        os.umask(before)
    assert file.path.stat().st_mode & 0o777 == 0o666 & ~mask
    file.discard()


def test_write_that_fails_is_made_up_for_and_the_file_is_whole_in_between(tmp_path: Path) -> None:
    file = GrowingFile(tmp_path / "run.mcap")
    assert file.write(b"a" * 100)
    with at_most(150):
        assert not file.write(b"b" * 100)
        assert "File too large" in file.problem
        assert file.path.read_bytes() == b"a" * 100
        assert not file.write(bytearray(b"c" * 10))
        assert file.waiting == 110
    assert file.write(b"")
    assert (file.problem, file.waiting) == ("", 0)
    assert file.path.read_bytes() == b"a" * 100 + b"b" * 100 + b"c" * 10
    file.discard()


@pytest.mark.parametrize("name_taken", [False, True])
def test_file_that_was_removed_is_made_again_with_its_contents_under_a_free_name(
    tmp_path: Path, name_taken: bool
) -> None:
    folder = tmp_path / "out"
    file = GrowingFile(folder / "run.mcap")
    assert file.write(b"before")
    file.path.unlink()
    folder.rmdir()
    if name_taken:
        folder.mkdir()
        (folder / "run.mcap").write_text("another one's")
    assert file.write(b" and after")
    assert file.path.name == ("run-2.mcap" if name_taken else "run.mcap")
    assert file.path.read_bytes() == b"before and after" and "made again" in file.news
    with pytest.raises(InUse):
        GrowingFile(file.path)
    file.discard()
    assert len(list(folder.iterdir())) == name_taken


def test_file_that_cannot_be_made_again_yet_is_made_when_it_can(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    file = GrowingFile(folder / "run.mcap")
    assert file.write(b"before")
    file.path.unlink()
    folder.rmdir()
    folder.write_text("a file in place of the folder")
    assert not file.write(b", during")
    folder.unlink()
    with at_most(3):
        assert not file.write(b"")
    assert list(folder.iterdir()) == []
    assert file.write(b" and after")
    assert file.path.read_bytes() == b"before, during and after"
    file.discard()


def test_patient_file_is_made_as_soon_as_it_can_be(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file in place of the folder")
    file = GrowingFile(tmp_path / "out" / "run.mcap", patient=True)
    assert file.problem
    assert not file.write(b"first")
    (tmp_path / "out").unlink()
    assert file.write(b", second") and not file.problem
    assert file.path.read_bytes() == b"first, second"
    file.discard()
