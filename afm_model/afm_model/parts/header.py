"""The beginning of an instrument's block: which parts were chosen, and where everything stands in it."""

from ..core.records import record
from .part import FAMILIES, Law, Part


def _places(family: type[Part]) -> list[str]:
    """What a kernel needs to know of a part: its number, the addresses of its functions, its records."""
    name = family.family
    return [name, *(f"{name}_{function}" for function in family.functions), f"{name}_constants", f"{name}_state"]


_OF_PARTS = [place for family in FAMILIES if family is not Law for place in _places(family)]
_OF_THE_LOOP = [
    "loop",
    "measurement",
    "commanded",
    "applied",
    "regulated",
    "effective",
    "asked",
    "asked_next",
    "truth",
    "detection",
    "surface",
    "displacement",
    "fault_memory",
    "sample_map",
    "plant_map",
    "score",
    "hashed",
    "hashed_end",
    "line",
    "channels",
    "channel_count",
    "disturbance",
    "detector_filter",
    "sensors",
    "read",
    "drift",
    "drifted",
    "limits",
    "guard",
    "position_noise",
    "noise",
    "wander",
    "faults",
    "draws",
]
HEADER = record(*_OF_PARTS, *_OF_THE_LOOP, integers=(*_OF_PARTS, *_OF_THE_LOOP))
"""Of each part: its number (OTHER if it is called by address), the addresses of its functions, where its constants and
its state begin.

Then where the rest begins: the record of the loop; measurement; the drive as commanded, as applied (behind range,
resolution, delay), as changed by the onboard part, as the piezo makes it; the reference at this tick and at the next;
truth, detection, surface; what a fault does to the sample, and what it remembers; the maps of sample and plant; sums of
the score; what is hashed; the line of drives on their way; the places of the channels; what the low-pass of the
detector remembers; constants of the position sensors and what they have read; the same of the drift; the limits, and
where they stand.

Last, where in a row of the random numbers those of the plant, the sensors, the detector, the drift and the fault begin,
and how long a row is.
"""

LAW_HEADER = record(*_places(Law), integers=tuple(_places(Law)))
"""The same for the block of a law, which stands apart: it may be in another process."""

OTHER = -1
"""Number of a part that is called by address."""
