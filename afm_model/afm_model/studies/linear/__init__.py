"""The closed loop of any law, linearised: is it stable at this rate and delay, and with what margin?

The scanner slides steadily along the reference, so that friction is a constant, over a flat sample, the tip near its
setpoint; the contact is a spring with a dashpot. The law is asked what it answers to small changes. docs/laws.md,
section 7.
"""

from .law import LinearError
from .loop import Cut, LinearLoop, at_timing, inside_drives_z, is_stable, largest, linearise
from .plant import nominal_friction

__all__ = [
    "Cut",
    "LinearError",
    "LinearLoop",
    "at_timing",
    "inside_drives_z",
    "is_stable",
    "largest",
    "linearise",
    "nominal_friction",
]
