"""Claims about names that a file cannot have, and disks that are full: one sentence, and nothing is lost."""

import os
import resource
import signal
from dataclasses import replace

import pytest

from afm_model.core.errors import ResultFileError
from afm_model.files import (
    ScanFile,
    read_scan,
    write_curve_tab,
    write_curves,
    write_dat,
    write_gsf,
    write_gwy,
    write_picture,
    write_scan,
    write_sheet,
    write_sxm,
    write_table,
)
from afm_model.files.result_files import Disk

from . import scans

IMAGE = replace(scans.scanned(pixels=16, lines=16), units={"height": "m"})
CURVE = scans.curve()
WRITERS = {
    "gwy": (".gwy", lambda path: write_gwy(path, IMAGE)),
    "gsf": (".gsf", lambda path: write_gsf(path, IMAGE)),
    "picture": (".png", lambda path: write_picture(path, IMAGE)),
    "sheet": (".png", lambda path: write_sheet(path, IMAGE)),
    "csv": (".csv", lambda path: write_table(path, IMAGE)),
    "txt": (".txt", lambda path: write_table(path, IMAGE)),
    "curves": (".h5", lambda path: write_curves(path, CURVE)),
    "sxm": (".sxm", lambda path: write_sxm(path, IMAGE)),
    "dat": (".dat", lambda path: write_dat(path, CURVE)),
    "tab": (".tab", lambda path: write_curve_tab(path, CURVE)),
    "scan": (".h5", lambda path: write_scan(path, IMAGE)),
}
every_writer = pytest.mark.parametrize(("suffix", "write"), WRITERS.values(), ids=list(WRITERS))


@every_writer
def test_name_that_a_file_cannot_have_is_refused_in_a_sentence(tmp_path, suffix, write):
    (tmp_path / f"folder{suffix}").mkdir()
    for name, why in (
        (f"missing/file{suffix}", f"there is no folder {tmp_path}/missing"),
        (f"folder{suffix}", "it is a folder"),
        ("file.doc", "its name must end with "),
        (f"{'x' * 300}{suffix}", ""),
    ):
        with pytest.raises(ResultFileError) as refused:
            write(tmp_path / name)
        assert str(refused.value).startswith(f"{tmp_path / name} cannot be written: {why}")
        assert "\n" not in str(refused.value)
    assert [each.name for each in tmp_path.iterdir()] == [f"folder{suffix}"]


@pytest.fixture
def full_disk():
    """A limit on the size of files: a write beyond it fails as on a full disk."""
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)

    def full(at: int) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (at, limits[1]))

    yield full
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    signal.signal(signal.SIGXFSZ, before)


@pytest.mark.parametrize(
    ("suffix", "write"),
    [each for name, each in WRITERS.items() if name != "scan"],
    ids=[n for n in WRITERS if n != "scan"],
)
def test_write_that_fails_leaves_the_file_that_was_there(tmp_path, full_disk, suffix, write):
    path = tmp_path / f"file{suffix}"
    write(path)
    before = path.read_bytes()
    full_disk(100)
    with pytest.raises(ResultFileError, match=r"cannot be written: [^\n]+$"):
        write(path)
    full_disk(-1)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_scan_for_which_there_is_no_place_on_the_disk_is_refused_before_it_begins(tmp_path, full_disk):
    image = scans.scanned(0)
    full_disk(60_000)
    with pytest.raises(ResultFileError, match=r"scan\.h5 cannot be written: File too large$"):
        ScanFile(tmp_path / "scan.h5", image.scan, image.units)
    full_disk(-1)
    assert not list(tmp_path.iterdir())


def test_line_that_the_disk_does_not_take_is_told_and_the_lines_before_are_kept(tmp_path, full_disk):
    image = scans.scanned(0)
    path = tmp_path / "scan.h5"
    file = ScanFile(path, image.scan, image.units)
    for index in range(64):
        for direction in ("trace", "retrace"):
            full_disk(60_000 if index >= 5 else -1)
            if index < 5:
                file.put(scans.line(image.scan, index, direction))
            else:
                with pytest.raises(ResultFileError, match=r"scan\.h5 cannot be written: File too large$"):
                    file.put(scans.line(image.scan, index, direction))
    full_disk(-1)
    file.close()
    wanted, read = scans.scanned(5), read_scan(path)
    for key, values in wanted.data.items():
        assert (read.data[key][:5] == values[:5]).all()


def test_folder_that_may_not_be_written_to_is_told(tmp_path):
    if os.geteuid() == 0:
        folder = "/proc"  # not even for root
    else:
        folder = str(tmp_path / "closed")
        os.mkdir(folder, 0o500)
    with pytest.raises(ResultFileError, match=r"cannot be written: (Permission denied|No such file)"):
        write_gsf(f"{folder}/scan.gsf", IMAGE)


def test_what_a_file_has_not_is_read_as_zeros(tmp_path):
    with Disk(tmp_path / "short", overwrite=False) as disk:
        disk.write(b"abc")
        disk.seek(1)
        read = bytearray(b"....")
        assert (disk.readinto(read), bytes(read)) == (4, b"bc\0\0")
        assert (disk.readinto(read), bytes(read)) == (4, bytes(4))
