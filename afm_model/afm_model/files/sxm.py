"""Scans as .sxm, the format of Nanonis controllers: a header of text, then every channel in single precision."""

import json
import math
import re
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import ParameterError, ResultFileError, reason
from ..core.schema import build
from ..microscope.image import DIRECTIONS, RETRACE, TRACE, Image, as_image
from ..microscope.verbs import Lift, Scan
from ..sample.map_reader import sxm
from .layers import TITLES
from .result_files import replacing

if TYPE_CHECKING:
    import xarray

_NAMES = TITLES | {"height": "Z"}
_CHANNELS = {title: name for name, title in _NAMES.items()}
_WAYS = {TRACE: "forward", RETRACE: "backward"}
_OWN = "Virtual AFM>Scan"
"""Key under which a file of this package has all fields of its scan and its notes."""
_SETPOINT = re.compile(r"(?:amplitude of |deflection of )?([-+.\de]+) ([pnµmk]?)(N|V|m|Hz)\b")
_PREFIXES = {"p": 1e-12, "n": 1e-9, "µ": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3}


def write_sxm(path: Path | str, image: "Image | xarray.Dataset", *, date: datetime | None = None) -> Path:
    """Write the channels of a scan into a .sxm file.

    Values are single precision in SI units, for each channel the trace and then the retrace. Rows are in the order in
    which they were scanned, those of the retrace from right to left; what is not measured is NaN. The angle of the
    format is clockwise. The height is the channel `Z`; the other names are the titles of the layers. Friction and
    crosstalk follow from trace and retrace, and are not written. The header is ASCII.

    Parameters
    ----------
    path : Path or str
        Ends with .sxm. A file of this name is replaced once the new one is whole.
    image : Image, or its labelled arrays
        A scan, as far as it came.
    date : datetime, optional
        When it began; without, the present time.

    Raises
    ------
    ResultFileError
        If it cannot be written.
    """
    image = as_image(image)
    up = image.scan.direction == "up"
    with replacing(path, ".sxm") as beside, beside.open("wb") as file:
        file.write(_ascii(_header(image, Path(path), date or datetime.now())))
        file.write(b"\x1a\x04")
        for channel in image.units:
            for direction in DIRECTIONS:
                values = image.data[channel, direction].astype(">f4")
                values = values if up else values[::-1]
                file.write((values[:, ::-1] if direction == RETRACE else values).tobytes())
    return Path(path)


def _ascii(text: str) -> bytes:
    return text.replace("µ", "u").replace("°", " deg").encode("ascii", "replace")


def _number(value: float) -> str:
    """Return a number with all its digits, as the format has it."""
    return repr(float(value)).replace("e", "E")


def _header(image: Image, path: Path, date: datetime) -> str:
    scan, notes = image.scan, image.metadata
    rate = image.line_rate or scan.line_rate
    half = _number(0.5 / rate)
    size = f"{_number(scan.size_x)} {_number(scan.height)}"
    place = f"{_number(scan.centre_x)} {_number(scan.centre_y)}"
    # `0 - ` makes no -0.
    angle = _number(0.0 - math.degrees(scan.angle))
    bias = "0.0"
    name, setpoint, gains = _loop(notes)
    table = ["\tChannel\tName\tUnit\tDirection\tCalibration\tOffset"]
    for number, (channel, unit) in enumerate(image.units.items()):
        title = _NAMES.get(channel, channel).replace(" ", "_")
        table.append(f"\t{number}\t{title}\t{unit}\tboth\t1.0E+0\t0.0E+0")
    own = {"verb": type(scan).__name__, **scan.model_dump(), **image.notes, "names": list(image.units), "notes": notes}
    pairs = {
        "NANONIS_VERSION": "2",
        "SCANIT_TYPE": "              FLOAT            MSBFIRST",
        "REC_DATE": f"{date:%d.%m.%Y}",
        "REC_TIME": f"{date:%H:%M:%S}",
        # A number, as readers want one: it is not known here.
        "REC_TEMP": "NaN",
        "ACQ_TIME": f"{image.lines_done / rate:.1f}",
        "SCAN_PIXELS": f"{scan.pixels} {scan.lines}",
        "SCAN_FILE": str(path.absolute()),
        "SCAN_TIME": f"{half} {half}",
        "SCAN_RANGE": size,
        "SCAN_OFFSET": place,
        "SCAN_ANGLE": angle,
        "SCAN_DIR": scan.direction,
        "BIAS": bias,
        "Z-CONTROLLER": f"\tName\ton\tSetpoint\tP-gain\tI-gain\tT-const\n\t{name}\t1\t{setpoint}\t{gains}",
        "COMMENT": "Scan of a virtual atomic force microscope (afm_model)",
        "Bias>Bias (V)": bias,
        "Scan>Scanfield": ";".join([*place.split(), *size.split(), angle]),
        "Scan>series name": path.stem,
        "Scan>channels": ";".join(f"{_NAMES.get(channel, channel)} ({unit})" for channel, unit in image.units.items()),
        "Scan>pixels/line": str(scan.pixels),
        "Scan>lines": str(scan.lines),
        "Scan>speed forw. (m/s)": _number(2.0 * rate * scan.size_x),
        "Scan>speed backw. (m/s)": _number(2.0 * rate * scan.size_x),
        _OWN: json.dumps(own),
        "DATA_INFO": "\n".join(table),
    }
    body = "".join(f":{key}:\n{value}\n" for key, value in pairs.items())
    return f"{body}\n:SCANIT_END:\n\n\n"


def _loop(notes: dict[str, str]) -> tuple[str, str, str]:
    """Name, setpoint and gains of the z loop with SI units, by the notes of the microscope; what is unknown is 0."""
    words = notes.get("Setpoint", "")
    found = _SETPOINT.match(words)
    value, unit = (float(found[1]) * _PREFIXES[found[2]], found[3]) if found else (0.0, "V")
    name = "Amplitude" if words.startswith("amplitude") else "Deflection"
    gains = {letter: float(number) for letter, number in re.findall(r"([PI]) = ([-+.\de]+)", notes.get("Gains", ""))}
    proportional, integral = gains.get("P", 0.0), gains.get("I", 0.0)
    constant = proportional / integral if integral else 0.0
    return name, f"{value:.6E} {unit}", f"{proportional:.6E} m/V\t{integral:.6E} m/V/s\t{constant:.6E} s"


def read_sxm(path: Path | str) -> Image:
    """Read a scan from a .sxm file, of this package or of others.

    The channel `Z` becomes `height`, other names of this package are translated the same way; unknown names stay. A
    channel without a way back is NaN there. Of files of others, line rate and time of the start are those that the
    header allows: the times of trace and retrace, and 0.

    Raises
    ------
    ResultFileError
        If it cannot be read, or is another kind of file; the message names it and says why.
    """
    try:
        return _image(sxm(Path(path).read_bytes()))
    except (OSError, ValueError, KeyError, TypeError, ParameterError) as error:
        raise ResultFileError(f"{path} cannot be read as a scan: {reason(error)}") from None


def _image(found: Any) -> Image:
    own = json.loads(found.header[_OWN]) if _OWN in found.header else {}
    # An underscore in a name cannot be told from a space by the table of channels.
    named = zip(found.units, own["names"], strict=True) if own else ((n, _CHANNELS.get(n, n)) for n in found.units)
    names = dict(named)
    units = {names[name]: unit for name, unit in found.units.items()}
    image = Image.empty(_own_scan(own) if own else _scan(found.header, list(units)), units)
    for (name, direction), values in found.images.items():
        way = TRACE if direction == _WAYS[TRACE] else RETRACE
        image.data[names[name], way][:] = values
    if own:
        image.take_notes(own)
        image.metadata = {str(name): str(value) for name, value in own["notes"].items()}
        return image
    image.line_rate = image.scan.line_rate
    first = image.data[next(iter(units)), TRACE]
    done = np.flatnonzero(np.isfinite(first).any(axis=1))
    image.lines_done = 1 + max((image.row(int(row)) for row in done), default=-1)
    image.complete = bool(np.isfinite(first).all())
    image.metadata = {name: " ".join(value.split()) for name, value in found.header.items() if name != "DATA_INFO"}
    return image


def _own_scan(own: dict[str, Any]) -> Scan:
    kind = Lift if own["verb"] == Lift.__name__ else Scan
    return build(kind, {name: own[name] for name in kind.model_fields})


def _scan(header: dict[str, str], channels: list[str]) -> Scan:
    """The scan that a header describes."""
    pixels, lines = (int(word) for word in header["SCAN_PIXELS"].split())
    size_x, size_y = (float(word) for word in header["SCAN_RANGE"].split())
    centre_x, centre_y = (float(word) for word in header.get("SCAN_OFFSET", "0 0").split())
    period = sum(float(word) for word in header.get("SCAN_TIME", "0.5 0.5").split())
    fields: dict[str, Any] = {
        **{"pixels": pixels, "lines": lines, "size_x": size_x, "size_y": size_y},
        **{"centre_x": centre_x, "centre_y": centre_y},
        "angle": -math.radians(float(header.get("SCAN_ANGLE", "0"))),
        "direction": header["SCAN_DIR"].strip(),
        "line_rate": 1.0 / period if period > 0.0 else 1.0,
        "channels": ", ".join(channels),
    }
    return build(Scan, fields)
