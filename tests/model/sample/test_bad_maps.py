"""Claims about map files that are none: each is refused in one sentence, by a process that may die of it."""

import io
import json
import os
import pickle
import struct
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_model import ParameterError
from afm_model.parameters import InstrumentParameters, build
from afm_model.sample import map_reader
from afm_model.sample.map_files import read_field
from afm_model.sample.map_reader import SUFFIXES, answer

from .test_samples import LEVER, gsf, gwy, sxm


def npy(values: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, values, allow_pickle=True)
    return file.getvalue()


def png(columns: int, rows: int) -> bytes:
    """One of a colour: its size is in its header, and next to nothing in the file."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    packer, row, content = zlib.compressobj(9), bytes(1 + columns), b""
    for _ in range(rows):
        content += packer.compress(row)
    content += packer.flush()
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", content) + chunk(b"IEND", b"")


def huge_header() -> bytes:
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000), }"
    head += b" " * (118 - len(head) - 1) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head


def nested(depth: int) -> bytes:
    content = b""
    for _ in range(depth):
        content = b"o\0o" + b"GwyContainer\0" + struct.pack("<I", len(content)) + content
    return b"GWYP" + b"GwyContainer\0" + struct.pack("<I", len(content)) + content


class Harmful:
    def __reduce__(self):
        return os.mkdir, ("harm",)


def archive() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as zipped:
        zipped.writestr("a.npy", npy(np.zeros((8, 8))))
    return file.getvalue()


FLAT = np.zeros((8, 8))
SXM = sxm(FLAT, 1e-6)
GWY, GSF, EPS = gwy(FLAT, 1e-6), gsf(FLAT, 1e-6), b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\nshowpage\n"
BAD = {
    "empty.npy": b"",
    "terabytes.npy": huge_header(),
    "pickle.npy": pickle.dumps(Harmful()),
    "objects.npy": npy(np.array([[Harmful()] * 8] * 8, dtype=object)),
    "archive.npy": archive(),
    "complex.npy": npy(np.zeros((8, 8), complex)),
    "cut.npy": npy(FLAT)[:-9],
    "line.npy": npy(np.zeros(64)),
    "no_header.npy": b"\x93NUMPY\x01\x00" + struct.pack("<H", 60) + b"(" * 60,
    "large.npy": npy(np.zeros((4096, 2048), np.uint8)),
    "empty.gsf": b"",
    "empty.sxm": b"",
    "cut.sxm": SXM[:-700],
    "large.sxm": SXM.replace(b"PIXELS:\n8 8", b"PIXELS:\n9999 9999"),
    "negative.sxm": SXM.replace(b"PIXELS:\n8 8", b"PIXELS:\n-8 -8"),
    "current.sxm": SXM.replace(b"\tZ\tm\t", b"\tCurrent\tA\t"),
    "no_channel.sxm": SXM.replace(b"\t14\tZ\tm\tboth\t1\t0\n", b""),
    "no_range.sxm": SXM.replace(b":SCAN_RANGE:", b":RANGE:"),
    "no_size.sxm": SXM.replace(b"1e-06 1e-06", b"nan nan"),
    "integers.sxm": SXM.replace(b"FLOAT MSBFIRST", b"INT MSBFIRST"),
    "negative.gsf": GSF.replace(b"XRes = 8", b"XRes = -1").replace(b"YRes = 8", b"YRes = 1"),
    "large.gsf": GSF.replace(b"XRes = 8", b"XRes = 9999999"),
    "words.gsf": GSF.replace(b"XRes = 8", b"XRes = x"),
    "no_size.gsf": GSF.replace(b"XReal = 1e-06", b"XReal = nan"),
    "endless.gsf": b"Gwyddion Simple Field 1.0\nXRes = 8\n",
    "empty.gwy": b"",
    "nested.gwy": nested(5000),
    "cut.gwy": GWY[:-40],
    "odd.gwy": GWY.replace(b"data\0D", b"data\0C"),
    "no_numbers.gwy": GWY.replace(b"data\0D", b"dota\0D"),
    "negative.gwy": GWY.replace(b"xres\0i" + struct.pack("<i", 8), b"xres\0i" + struct.pack("<i", -8)),
    "words.gwy": GWY.replace(b"xres\0i" + struct.pack("<i", 8), b"xres\0s" + b"abc\0"),
    "empty.png": b"",
    "large.png": png(3000, 3000),
    "program.png": EPS,
    "cut.tif": b"II*\0\x08\0\0\0",
    "text.jpg": b"\xff\xd8\xff" + b"a" * 99,
}


@pytest.mark.parametrize("name", BAD)
def test_bad_file_is_refused_in_one_sentence_with_its_path_and_what_is_allowed(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / name
    path.write_bytes(BAD[name])
    with pytest.raises(ParameterError) as refused:
        build(InstrumentParameters, LEVER | {"sample.kind": "map", "sample.file": str(path)})
    told = str(refused.value)
    assert told.startswith(f"{path} cannot be read as a height map: ")
    assert "allowed are .npy" in told and "\n" not in told and len(told) < 900
    assert not (tmp_path / "harm").exists()


@pytest.mark.parametrize("path", ["x" * 5000 + ".npy", "a\0b.npy", "/dev/zero", "/", "none.npy", "\udcff.npy"])
def test_path_that_names_no_file_is_refused_in_a_sentence(path):
    with pytest.raises(ParameterError, match=r"^there is no file ") as refused:
        build(InstrumentParameters, LEVER | {"sample.kind": "map", "sample.file": path})
    assert len(str(refused.value)) < 400


def test_image_of_60000_by_60000_is_refused_by_its_header(tmp_path):
    head = struct.pack(">IIBBBBB", 60_000, 60_000, 8, 0, 0, 0, 0)
    chunk = struct.pack(">I", len(head)) + b"IHDR" + head + struct.pack(">I", zlib.crc32(b"IHDR" + head))
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + chunk + struct.pack(">I", 0) + b"IDAT" + bytes(4))
    with pytest.raises(ValueError, match="it has 60000 x 60000 values"):
        read_field(str(tmp_path / "a.png"))


@pytest.mark.parametrize("harm", ["os.abort()", "bytearray(1 << 40)", "bytearray(3 << 30)", "sys.exit('x')", "0 / 0"])
def test_reader_that_dies_of_a_file_takes_nobody_with_it(tmp_path, monkeypatch, harm):
    # What a library for images might do: the reader itself, with another function that reads.
    spoiled = tmp_path / "reader.py"
    text = (
        Path(map_reader.__file__)
        .read_text()
        .replace("def _read(path: str) -> _Found:\n", f"def _read(path):\n    {harm}\n")
    )
    assert harm in text
    spoiled.write_text(text)
    (tmp_path / "a.npy").write_bytes(npy(FLAT))
    monkeypatch.setattr("afm_model.sample.map_files._READER", spoiled)
    with pytest.raises(ValueError, match=r"a\.npy cannot be read as a height map: .*; allowed are"):
        read_field(str(tmp_path / "a.npy"))


GOOD = {
    ".npy": npy(FLAT),
    ".gsf": GSF,
    ".gwy": GWY,
    ".sxm": SXM,
    ".png": png(8, 8),
    ".tif": png(8, 8),
    ".jpg": png(8, 8),
}


@given(
    st.sampled_from(sorted(GOOD)),
    st.one_of(
        st.binary(max_size=400),
        st.tuples(st.integers(0, 600), st.binary(max_size=12)),
        st.lists(st.tuples(st.integers(0, 600), st.integers(0, 255)), min_size=1, max_size=6),
    ),
)
def test_spoiled_file_of_any_format_is_a_map_of_bounded_finite_numbers_or_a_sentence(tmp_path_factory, suffix, spoil):
    content = bytearray(GOOD[suffix])
    if isinstance(spoil, bytes):
        content = bytearray(spoil)
    elif isinstance(spoil, tuple):
        content[spoil[0] : spoil[0]] = spoil[1]
    else:
        for at, value in spoil:
            content[at % len(content)] = value
    path = tmp_path_factory.getbasetemp() / f"spoiled{suffix}"
    path.write_bytes(content)
    head, _, numbers = answer(str(path)).partition(b"\n")
    found = json.loads(head)
    if "problem" in found:
        assert len(found["problem"]) <= 300
        return
    values = np.frombuffer(numbers).reshape(found["shape"])
    assert values.size <= map_reader.MOST_VALUES and np.isfinite(values).all()
    assert 0.0 <= found["width"] < np.inf and 0.0 <= found["height"] < np.inf


def test_scenario_with_a_bad_map_ends_in_a_sentence_without_ros_too(tmp_path):
    (tmp_path / "empty.npy").write_bytes(b"")
    scenario = tmp_path / "bad.yaml"
    sample = f"{{kind: map, file: {tmp_path}/empty.npy, width: 1.0e-6}}"
    scenario.write_text(f"/**/afm_sim_node:\n  ros__parameters:\n    plant: {{kind: lever}}\n    sample: {sample}\n")
    done = subprocess.run([sys.executable, "-m", "afm_model", scenario], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    (told,) = done.stderr.splitlines()
    assert told.startswith("error: ") and f"{tmp_path}/empty.npy cannot be read as a height map: " in told


def test_every_suffix_is_tried():
    assert {*GOOD, ".tiff"} == set(SUFFIXES)
