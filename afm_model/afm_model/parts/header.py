"""The beginning of an instrument's block: which parts were chosen, and where everything stands in it."""

from ..core.records import record
from .part import FAMILIES, Law, Part


def _places(family: type[Part]) -> list[str]:
    """What a kernel needs to know of a part: the addresses of its functions, its records."""
    name = family.family
    return [*(f"{name}_{function}" for function in family.functions), f"{name}_constants", f"{name}_state"]


_OF_PARTS = [place for family in FAMILIES if family is not Law for place in _places(family)]
_OF_THE_LOOP = [
    "loop",
    "measurement",
    "commanded",
    "received",
    "applied",
    "regulated",
    "effective",
    "asked",
    "asked_next",
    "truth",
    "detection",
    "surface",
    "displacement",
    "delivery",
    "sample_map",
    "plant_map",
    "score",
    "hashed",
    "hashed_end",
    "line",
    "channels",
    "channel_count",
    "disturbance",
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
"""Of each part: the addresses of its functions (0: it has none), where its constants and its state begin.

Then where the rest begins: the record of the loop; measurement; the drive as commanded, as received behind a fault
(its address), as applied (behind range, resolution, delay), as changed by the onboard part, as the piezo makes it; the
reference at this tick and at the next; truth, detection, surface; what a fault does to the sample and to a
measurement; the maps of sample and plant; sums of the score; what is hashed; the line of drives on their way; the
places of the channels; constants of the position sensors and what they have read; the same of the drift; the limits,
and where they stand.

Last, where in a row of the random numbers those of the plant, the sensors, the detector, the drift and the fault begin,
and how long a row is.
"""

LAW_HEADER = record(*_places(Law), integers=tuple(_places(Law)))
"""The same for the block of a law, which stands apart: it may be in another process."""
