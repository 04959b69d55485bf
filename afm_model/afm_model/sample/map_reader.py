"""The program that reads one map file: `python map_reader.py PATH`. It imports numpy and no part of this package.

It writes a line of JSON, and after it the numbers: `{"shape": [rows, columns], "width": , "height": }`, or
`{"problem": a sentence}`. Whatever a file holds, this process is the one that it takes down: see `map_files`.
"""

import json
import math
import os
import resource
import signal
import struct
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

SUFFIXES = (".npy", ".gsf", ".gwy", ".sxm", ".png", ".tif", ".tiff", ".jpg")
MOST_VALUES = 2048 * 2048
"""Of a map: the instrument then takes seconds to put it in, and 300 MB meanwhile."""
MOST_BYTES = 1 << 29
PROCESSOR_TIME, MEMORY = 20, 2 << 30
"""Of this process [s], [bytes]."""
_DEEPEST = 50
"""Objects of a Gwyddion file inside one another."""
_Found = tuple[Any, float, float]
"""Values, with row 0 at the least y; size along x and y [m], 0 if the file does not contain it."""


def answer(path: str) -> bytes:
    """What is written for a file, whatever it holds."""
    try:
        values, width, height = _read(path)
        if values.ndim != 2 or min(values.shape) < 4:
            raise ValueError(f"it must be an array of at least 4 x 4, it is {values.shape}")
        values = np.ascontiguousarray(values, dtype="<f8")
        if not (finite := np.isfinite(values)).all():
            row, column = (int(index[0]) for index in np.nonzero(~finite))
            raise ValueError(f"the value of row {row}, column {column} is no finite number")
        if not (0.0 <= width < math.inf and 0.0 <= height < math.inf):
            raise ValueError(f"its size, {width:g} x {height:g} m, must be finite and not negative")
    # A reader may raise anything: MemoryError, RecursionError, EOFError, errors of its own.
    except BaseException as error:
        known = isinstance(error, ValueError | OSError) and str(error)
        problem = str(error) if known else f"{type(error).__name__}: {error}"
        return json.dumps({"problem": " ".join(problem.split())[:300]}).encode() + b"\n"
    head = {"shape": values.shape, "width": width, "height": height}
    return json.dumps(head).encode() + b"\n" + values.tobytes()


def _read(path: str) -> _Found:
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"its name must end with one of {', '.join(SUFFIXES)}")
    if (size := os.stat(path).st_size) > MOST_BYTES:
        raise ValueError(f"it has {size} bytes")
    if suffix == ".npy":
        return _npy(path)
    if suffix == ".gsf":
        return _gsf(Path(path).read_bytes())
    if suffix == ".gwy":
        return _gwy(Path(path).read_bytes())
    if suffix == ".sxm":
        return _sxm(Path(path).read_bytes())
    return _image(path)


def _allowed(columns: int, rows: int) -> None:
    """Refuse a size by the header, before anything of that size is made."""
    if min(columns, rows) < 1 or columns * rows > MOST_VALUES:
        raise ValueError(f"it has {columns} x {rows} values")


def _npy(path: str) -> _Found:
    # Mapped: nothing is read before its size is known.
    array = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "biuf":
        raise ValueError("it must be one array of real numbers")
    _allowed(array.size, 1)
    return array, 0.0, 0.0


def _image(path: str) -> _Found:
    try:
        # Needed for images alone; a dependency of matplotlib.
        from PIL import Image
    except ImportError:
        raise ValueError("images need the package Pillow, which is not installed") from None
    Image.MAX_IMAGE_PIXELS = None  # bounded here
    # By content, whatever the name is: others make Pillow call programs such as Ghostscript.
    with Image.open(path, formats=("PNG", "TIFF", "JPEG")) as picture:
        _allowed(*picture.size)
        # 16 bits and floating point are kept.
        kind = picture.mode[0]
        grey = np.asarray(picture if kind in "IF" else picture.convert("L"), dtype=np.float64)
    return grey[::-1] / {"I": 65535.0, "F": 1.0}.get(kind, 255.0), 0.0, 0.0


def _gsf(content: bytes) -> _Found:
    """Gwyddion Simple Field."""
    if not content.startswith(b"Gwyddion Simple Field 1.0\n"):
        raise ValueError("it does not begin as a Gwyddion Simple Field 1.0")
    end = content.index(b"\0")
    lines = content[:end].decode().splitlines()[1:]
    header = {name.strip(): value.strip() for name, _, value in (line.partition("=") for line in lines)}
    columns, rows = int(header["XRes"]), int(header["YRes"])
    _allowed(columns, rows)
    values = np.frombuffer(content, "<f4", columns * rows, (end // 4 + 1) * 4).reshape(rows, columns)
    return values[::-1], float(header.get("XReal", 0.0)), float(header.get("YReal", 0.0))


def _gwy(content: bytes) -> _Found:
    """The first GwyDataField of a Gwyddion file."""
    if not content.startswith(b"GWYP"):
        raise ValueError("it does not begin as a Gwyddion file")
    name, items, _ = _object(content, 4)
    field = _first_field(name, items)
    if field is None:
        raise ValueError("it holds no GwyDataField")
    columns, rows = int(field["xres"]), int(field["yres"])
    _allowed(columns, rows)
    values = np.asarray(field["data"]).reshape(rows, columns)
    return values[::-1], float(field.get("xreal", 0.0)), float(field.get("yreal", 0.0))


def _first_field(name: str, items: dict[str, Any]) -> dict[str, Any] | None:
    if name == "GwyDataField":
        return items
    for value in items.values():
        if isinstance(value, tuple) and (found := _first_field(*value)) is not None:
            return found
    return None


_NUMBERS = {"b": "<?", "c": "<c", "i": "<i", "q": "<q", "d": "<d"}


def _object(content: bytes, at: int, depth: int = 0) -> tuple[str, dict[str, Any], int]:
    """Name and items of the serialized object at a place of a Gwyddion file, and where it ends."""
    if depth > _DEEPEST:
        raise ValueError(f"its objects stand more than {_DEEPEST} deep in one another")
    end_of_name = content.index(b"\0", at)
    name = content[at:end_of_name].decode()
    (size,) = struct.unpack_from("<I", content, end_of_name + 1)
    at, end = end_of_name + 5, end_of_name + 5 + size
    items: dict[str, Any] = {}
    while at < end:
        end_of_key = content.index(b"\0", at)
        key, kind = content[at:end_of_key].decode(), chr(content[end_of_key + 1])
        at = end_of_key + 2
        if kind in _NUMBERS:
            (items[key],) = struct.unpack_from(_NUMBERS[kind], content, at)
            at += struct.calcsize(_NUMBERS[kind])
        elif kind == "s":
            end_of_text = content.index(b"\0", at)
            items[key], at = content[at:end_of_text].decode(), end_of_text + 1
        elif kind == "o":
            inner, inner_items, at = _object(content, at, depth + 1)
            items[key] = (inner, inner_items)
        elif kind in "CIQD":
            (count,) = struct.unpack_from("<I", content, at)
            number = np.dtype({"C": "S1", "I": "<i4", "Q": "<i8", "D": "<f8"}[kind])
            items[key] = np.frombuffer(content, number, count, at + 4)
            at += 4 + count * number.itemsize
        else:
            raise ValueError(f"its component {key} has the kind {kind}, which is not read")
    return name, items, end


class Sxm(NamedTuple):
    """A .sxm file: header and images, in order, each with column 0 on the left and row 0 at the least y."""

    header: dict[str, str]
    """Text by key, as `SCAN_RANGE`."""
    units: dict[str, str]
    """Of the channels, by name, in the order of the file; names have their spaces."""
    images: dict[tuple[str, str], Any]
    """Numbers (rows, columns) by name of the channel and direction, `forward` or `backward`; NaN: not measured."""


def sxm(content: bytes) -> Sxm:
    """Read a .sxm file from its bytes.

    Raises
    ------
    ValueError
        If it is not a .sxm file, or is shorter than its header says.
    """
    head, ended, data = content.partition(b"\n:SCANIT_END:\n")
    # Two bytes mark where the numbers begin.
    mark = data[:16].find(b"\x1a\x04")
    if not content.startswith(b":NANONIS_VERSION:") or not ended or mark < 0:
        raise ValueError("it is no .sxm file: it must begin with :NANONIS_VERSION:, and have :SCANIT_END: and 1A 04")
    header: dict[str, str] = {}
    key = ""
    for line in head.decode("latin-1").splitlines():
        if len(line) > 2 and line.startswith(":") and line.endswith(":"):
            key = line[1:-1]
            header[key] = ""
        else:
            header[key] += f"{line}\n"
    if missing := [name for name in ("SCAN_PIXELS", "SCAN_RANGE", "SCAN_DIR", "DATA_INFO") if name not in header]:
        raise ValueError(f"its header has no {missing[0]}")
    if (kind := header.get("SCANIT_TYPE", "FLOAT MSBFIRST").split()) != ["FLOAT", "MSBFIRST"]:
        raise ValueError(f"its SCANIT_TYPE is {' '.join(kind)}, which is not read")
    columns, rows = (int(word) for word in header["SCAN_PIXELS"].split())
    _allowed(columns, rows)
    titles, *table = ([word.strip() for word in line.strip().split("\t")] for line in _filled(header["DATA_INFO"]))
    if not table:
        raise ValueError("its DATA_INFO has no channel")
    units: dict[str, str] = {}
    images: dict[tuple[str, str], Any] = {}
    at = mark + 2
    for each in table:
        row = dict(zip(titles, each, strict=False))
        name = row["Name"].replace("_", " ")
        units[name] = row["Unit"]
        for direction in ("forward", "backward") if row["Direction"] == "both" else (row["Direction"],):
            stored = np.frombuffer(data, ">f4", columns * rows, at).reshape(rows, columns)
            at += stored.nbytes
            # Rows are stored as they were scanned, those of the way back from right to left.
            upwards = stored if header["SCAN_DIR"].strip() == "up" else stored[::-1]
            images[name, direction] = upwards[:, ::-1] if direction == "backward" else upwards
    return Sxm({name: value.strip() for name, value in header.items()}, units, images)


def _filled(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.strip()]


def _sxm(content: bytes) -> _Found:
    """The heights of a .sxm file, on the way forth."""
    found = sxm(content)
    if ("Z", "forward") not in found.images:
        raise ValueError(f"it has no channel Z, its channels are {', '.join(found.units)}")
    width, height = (float(word) for word in found.header["SCAN_RANGE"].split())
    return found.images["Z", "forward"], width, height


def main() -> None:
    """Read the file that the command line names, within bounds of memory and time."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of the terminal: whoever waits for this process decides
    with suppress(OSError):
        # A node's loop may run under SCHED_FIFO, which would be inherited.
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_TIME, PROCESSOR_TIME))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    sys.stdout.buffer.write(answer(sys.argv[1]))


if __name__ == "__main__":
    main()
