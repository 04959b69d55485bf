"""Claims about scans written line by line."""

import os
import signal
import subprocess
import sys
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest

from afm_model.core.errors import ResultFileError
from afm_model.files import ScanFile, read_scan, write_gwy, write_scan
from afm_model.microscope.image import DIRECTIONS, RETRACE, TRACE, Line
from afm_model.microscope.verbs import Scan

from . import scans

TESTS = Path(__file__).resolve().parents[2]


def same(one, other) -> None:
    """Two images are equal, to the last bit."""
    assert (one.scan, one.units, list(one.units)) == (other.scan, other.units, list(other.units))
    assert (one.start, one.line_rate, one.lines_done) == (other.start, other.line_rate, other.lines_done)
    assert (one.complete, one.metadata) == (other.complete, other.metadata)
    for key, values in one.data.items():
        np.testing.assert_array_equal(values, other.data[key])


@pytest.mark.parametrize("lines_done", [None, 20, 0])
@pytest.mark.parametrize("direction", ["up", "down"])
def test_scan_is_read_as_it_was_written(tmp_path, lines_done, direction):
    image = scans.scanned(lines_done, direction=direction, angle=0.5, pixels=48, size_y=50e-9)
    same(read_scan(write_scan(tmp_path / "scan.h5", image)), image)


def test_lines_as_they_come_give_the_scan_and_the_time_of_each(tmp_path):
    image = scans.scanned(direction="down")
    path = tmp_path / "scan.h5"
    with ScanFile(path, image.scan, None, image.metadata, start=0.5, line_rate=0.998) as file:
        for index in range(64):
            for direction in DIRECTIONS:
                file.put(scans.line(image.scan, index, direction))
    same(read_scan(path), image)
    with h5py.File(path) as file:
        # The first line of a scan downwards is the last row.
        assert (file["time/trace"][-1], file["time/retrace"][0]) == (0.5, 64.0)
        assert file["channels/height/trace"].attrs["units"] == "m"
        np.testing.assert_array_equal(file["x"][:], image.x)


def test_signals_of_any_name_are_written_and_read(tmp_path):
    scan = Scan(pixels=4, lines=2, channels="x, time, truth/place_x")
    units = {"x": "m", "time": "s", "truth/place_x": "m"}
    path = tmp_path / "scan.h5"
    with ScanFile(path, scan, units) as file:
        file.put(Line(0, TRACE, 0.0, {name: np.full(4, number) for number, name in enumerate(units, 1)}))
    image = read_scan(path)
    assert image.units == units
    assert [image.data[name, TRACE][0, 0] for name in units] == [1.0, 2.0, 3.0]
    write_gwy(tmp_path / "scan.gwy", image)


def test_signal_whose_unit_nobody_knows_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"the unit of the channel truth/place_x is not known; give units"):
        ScanFile(tmp_path / "scan.h5", Scan(channels="height, truth/place_x"))
    assert not list(tmp_path.iterdir())


def test_a_program_that_is_killed_leaves_every_line_that_it_had_measured(tmp_path):
    script = f"""
import sys, os, signal
sys.path.insert(0, {str(TESTS)!r})
from model.files import scans
from afm_model.files import ScanFile
scan = scans.scanned(0).scan
file = ScanFile("scan.h5", scan, scans.UNITS)
for index in range(7):
    for direction in ("trace", "retrace"):
        file.put(scans.line(scan, index, direction))
file.put(scans.line(scan, 7, "trace"))
os.kill(os.getpid(), signal.SIGKILL)
"""
    killed = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=dict(os.environ), timeout=60, check=False)
    assert killed.returncode == -signal.SIGKILL
    image = read_scan(tmp_path / "scan.h5")
    wanted = scans.scanned(7)
    wanted.put(scans.line(wanted.scan, 7, TRACE))
    assert (image.lines_done, image.complete) == (7, False)
    for key, values in wanted.data.items():
        np.testing.assert_array_equal(image.data[key], values)


def test_memory_stays_as_it_is_however_long_the_scan(tmp_path):
    """256 x 256 in five channels is 5 MB: line by line it is held nowhere."""
    names = ("height", "error", "lateral", "x", "y")
    scan = Scan(pixels=256, lines=256, channels=", ".join(names))
    values = {name: np.linspace(0.0, 1e-9, 256) for name in names}
    path = tmp_path / "scan.h5"
    with ScanFile(path, scan, dict.fromkeys(names, "m")) as file:

        def put(lines) -> None:
            for index in lines:
                for direction in DIRECTIONS:
                    file.put(Line(index, direction, float(index), values))

        put(range(16))
        before = resident()
        put(range(16, 248))
        grown = resident() - before
        tracemalloc.start()
        put(range(248, 256))
        held, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert path.stat().st_size > 5e6
    # 4.8 MB have been written in between; a line is 10 kB.
    assert grown < 1e6
    assert held < 2e4 and most < 1e5
    assert read_scan(path).complete


def resident() -> int:
    """Memory of this process [byte]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_a_scan_that_is_there_is_not_overwritten_unless_it_is_said(tmp_path):
    path = write_scan(tmp_path / "scan.h5", scans.scanned(20))
    with pytest.raises(ResultFileError, match=r"scan\.h5 cannot be written: it is there already; give another name"):
        write_scan(path, scans.scanned(3))
    assert read_scan(path).lines_done == 20
    write_scan(path, scans.scanned(3), overwrite=True)
    assert read_scan(path).lines_done == 3


def test_a_line_of_no_place_in_the_scan_or_after_its_end_is_refused_and_the_rest_kept(tmp_path):
    image = scans.scanned(0, lines=4)
    path = tmp_path / "scan.h5"
    file = ScanFile(path, image.scan, image.units)
    file.put(scans.line(image.scan, 0, RETRACE))
    with pytest.raises(ResultFileError, match="line 4 is not one of its 4 lines"):
        file.put(Line(4, TRACE, 0.0, {}))
    file.close()
    file.close()
    with pytest.raises(ResultFileError, match="it is closed"):
        file.put(scans.line(image.scan, 1, TRACE))
    assert read_scan(path).lines_done == 1


@pytest.mark.parametrize("content", [b"", b"no HDF5", None], ids=["empty", "text", "another HDF5"])
def test_file_of_another_kind_is_refused_in_a_sentence(tmp_path, content):
    path = tmp_path / "scan.h5"
    if content is None:
        h5py.File(path, "w").close()
    else:
        path.write_bytes(content)
    with pytest.raises(ResultFileError, match=r"scan\.h5 (is no scan|cannot be read as a scan): [^\n]+$"):
        read_scan(path)


def test_file_whose_numbers_are_impossible_is_refused_with_the_number(tmp_path):
    path = write_scan(tmp_path / "scan.h5", scans.scanned(3))
    with h5py.File(path, "a") as file:
        file.attrs["line_rate"] = -1.0
    with pytest.raises(ResultFileError, match="cannot be read as a scan: line_rate"):
        read_scan(path)
