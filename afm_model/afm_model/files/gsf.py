"""One layer of a scan as Gwyddion Simple Field, .gsf."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..microscope.image import Image, as_image
from .describing import description
from .layers import layer
from .writing import replacing

if TYPE_CHECKING:
    import xarray

_MAGIC = "Gwyddion Simple Field 1.0\n"


def write_gsf(path: Path | str, image: "Image | xarray.Dataset", name: str = "height_trace") -> Path:
    """Write one layer of a scan into a .gsf file.

    Row 0 of the file is the top of the picture, that is the largest y of the frame. Values are single precision in SI
    units; what is not measured is NaN, which Gwyddion masks.

    Parameters
    ----------
    path : Path or str
        Ends with .gsf. A file of this name is replaced once the new one is whole.
    image : Image, or its labelled arrays
        A scan, as far as it came.
    name : str
        Of the layer, as `height_trace` or `friction`.

    Returns
    -------
    Path

    Raises
    ------
    ResultFileError
        If it cannot be written.
    ValueError
        If the scan has no such layer.

    Source: the format's description in Gwyddion's user guide.
    """
    image = as_image(image)
    found, scan = layer(image, name), image.scan
    lines = {
        "XRes": str(scan.pixels),
        "YRes": str(scan.lines),
        "XReal": repr(float(scan.size_x)),
        "YReal": repr(float(scan.height)),
        "XOffset": repr(float(scan.centre_x - 0.5 * scan.size_x)),
        "YOffset": repr(float(scan.centre_y - 0.5 * scan.height)),
        "Title": found.title,
        "XYUnits": "m",
        "ZUnits": "" if found.unit == "1" else found.unit,
    }
    # Readers cut a line at its '='.
    notes = {_plain(title): _plain(value) for title, value in description(image).items()}
    header = _MAGIC + "".join(f"{key} = {value}\n" for key, value in (lines | notes).items())
    encoded = header.encode()
    with replacing(path, ".gsf") as beside:
        padding = b"\0" * (4 - len(encoded) % 4)
        beside.write_bytes(encoded + padding + found.values[::-1].astype("<f4").tobytes())
    return Path(path)


def _plain(words: str) -> str:
    return words.replace(" = ", " ").replace("=", " ").replace("\0", "")
