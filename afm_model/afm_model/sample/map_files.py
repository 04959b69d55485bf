"""Height maps from files: .npy, .gsf, .gwy, images. Rows go along y, upwards."""

import importlib
import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
SUFFIXES = (".npy", ".gsf", ".gwy", ".png", ".tif", ".tiff", ".jpg")


class Field(NamedTuple):
    """A map as a file holds it."""

    values: _Array  # (rows, columns), row 0 at the least y
    width: float  # [m]; 0 if the file does not contain it
    height: float


def read_field(path: str) -> Field:
    """The first map of a file.

    Parameters
    ----------
    path : str
        Of .npy and images the unit is the user's; .gsf and .gwy are in metres. Images are read as grey, 0 to 1, those
        in floating point as they are.

    Raises
    ------
    ValueError
        If it cannot be read as a map of finite numbers; the message names the file and what is wrong.
    """
    suffix = Path(path).suffix.lower()
    try:
        if suffix == ".npy":
            found = Field(np.load(path, allow_pickle=False), 0.0, 0.0)
        elif suffix == ".gsf":
            found = _gsf(Path(path).read_bytes())
        elif suffix == ".gwy":
            found = _gwy(Path(path).read_bytes())
        elif suffix in SUFFIXES:
            found = _image(path)
        else:
            raise ValueError(f"its name must end with one of {', '.join(SUFFIXES)}")
        values = np.asarray(found.values, dtype=np.float64)
    except (OSError, ValueError, KeyError, struct.error, SyntaxError) as error:
        raise ValueError(f"{path} cannot be read as a height map: {error}") from None
    if values.ndim != 2 or min(values.shape) < 4:
        raise ValueError(f"{path} is no height map: it must be an array of at least 4 x 4, it is {values.shape}")
    if not np.isfinite(values).all():
        row, column = (int(index[0]) for index in np.nonzero(~np.isfinite(values)))
        raise ValueError(f"{path} is no height map: the value of row {row}, column {column} is no finite number")
    return found._replace(values=values)


def _image(path: str) -> Field:
    try:
        # Needed for images alone; a dependency of matplotlib.
        image: Any = importlib.import_module("PIL.Image")
    except ImportError:
        raise ValueError("images need the package Pillow, which is not installed") from None
    with image.open(path) as picture:
        # 16 bits and floating point are kept.
        kind = picture.mode[0]
        grey = np.asarray(picture if kind in "IF" else picture.convert("L"), dtype=np.float64)
    return Field(grey[::-1] / {"I": 65535.0, "F": 1.0}.get(kind, 255.0), 0.0, 0.0)


def _gsf(content: bytes) -> Field:
    """Gwyddion Simple Field."""
    if not content.startswith(b"Gwyddion Simple Field 1.0\n"):
        raise ValueError("it does not begin as a Gwyddion Simple Field 1.0")
    end = content.index(b"\0")
    lines = content[:end].decode().splitlines()[1:]
    header = {name.strip(): value.strip() for name, _, value in (line.partition("=") for line in lines)}
    columns, rows = int(header["XRes"]), int(header["YRes"])
    start = (end // 4 + 1) * 4
    values = np.frombuffer(content, "<f4", columns * rows, start).reshape(rows, columns)
    return Field(values[::-1].astype(np.float64), float(header.get("XReal", 0.0)), float(header.get("YReal", 0.0)))


def _gwy(content: bytes) -> Field:
    """The first GwyDataField of a Gwyddion file."""
    if not content.startswith(b"GWYP"):
        raise ValueError("it does not begin as a Gwyddion file")
    name, items, _ = _object(content, 4)
    field = _first_field(name, items)
    if field is None:
        raise ValueError("it holds no GwyDataField")
    values = np.asarray(field["data"]).reshape(int(field["yres"]), int(field["xres"]))
    return Field(values[::-1].astype(np.float64), float(field.get("xreal", 0.0)), float(field.get("yreal", 0.0)))


def _first_field(name: str, items: dict[str, Any]) -> dict[str, Any] | None:
    if name == "GwyDataField":
        return items
    for value in items.values():
        if isinstance(value, tuple) and (found := _first_field(*value)) is not None:
            return found
    return None


_NUMBERS = {"b": "<?", "c": "<c", "i": "<i", "q": "<q", "d": "<d"}


def _object(content: bytes, at: int) -> tuple[str, dict[str, Any], int]:
    """Name and items of the serialized object at a place of a Gwyddion file, and where it ends."""
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
            inner, inner_items, at = _object(content, at)
            items[key] = (inner, inner_items)
        elif kind in "CIQD":
            (count,) = struct.unpack_from("<I", content, at)
            number = np.dtype({"C": "S1", "I": "<i4", "Q": "<i8", "D": "<f8"}[kind])
            items[key] = np.frombuffer(content, number, count, at + 4)
            at += 4 + count * number.itemsize
        else:
            raise ValueError(f"its component {key} has the kind {kind}, which is not read")
    return name, items, end
