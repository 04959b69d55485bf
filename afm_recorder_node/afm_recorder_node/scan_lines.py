"""The lines of scans, and the images that they make. Needs no ROS."""

from collections.abc import Iterable
from dataclasses import dataclass

from afm_model.microscope.image import Image, Line
from afm_model.microscope.verbs import Scan


@dataclass(frozen=True)
class ScanLine:
    """One direction of one line, and the scan that it belongs to."""

    number: int
    """Of the scan, since the start of the instrument."""
    scan: Scan
    line: Line
    units: dict[str, str]
    """SI unit of each channel."""

    @property
    def time_ns(self) -> int:
        """Simulated time at which its first pixel began [ns]."""
        return round(self.line.time * 1e9)


def images(lines: Iterable[ScanLine]) -> list[Image]:
    """Images in the order of their scans, whole or as far as they came."""
    made: dict[int, Image] = {}
    for line in sorted(lines, key=lambda line: (line.number, line.line.number)):
        if line.number not in made:
            made[line.number] = Image.empty(line.scan, line.units)
        made[line.number].put(line.line)
    for image in made.values():
        image.date()
    return list(made.values())
