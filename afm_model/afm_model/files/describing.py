"""What is written beside the values of a scan: in words, with units."""

import math

from ..core.prefix import text
from ..microscope.image import Image


def description(image: Image) -> dict[str, str]:
    """Names and texts, as programs list them: the frame, how it was scanned, how far it came, and the scan's own notes.

    Parameters
    ----------
    image : Image

    Returns
    -------
    dict of str to str
        Without line breaks. Numbers in base units are in the files besides; these are to be read by people.
    """
    scan = image.scan
    slow = (
        f"{scan.direction}, from the {'least' if scan.direction == 'up' else 'largest'} y" if scan.slow_axis else "off"
    )
    words = {
        "Scan size": f"{text(scan.size_x, 'm')} x {text(scan.height, 'm')}",
        "Scan centre": f"x = {text(scan.centre_x, 'm')}, y = {text(scan.centre_y, 'm')}",
        "Scan angle": f"{math.degrees(scan.angle):.6g} deg, of the fast direction against x, counterclockwise",
        "Pixels": f"{scan.pixels} x {scan.lines}",
        "Line rate": f"{image.line_rate or scan.line_rate:.6g} Hz, a line is trace and retrace",
        "Overscan": f"{scan.overscan:.6g}",
        "Slow axis": slow,
        "Lines measured": f"{image.lines_done} of {scan.lines}",
        "Start": f"{image.start:.9g} s of simulated time",
    }
    return words | {str(name): " ".join(str(value).split()) for name, value in image.metadata.items()}
