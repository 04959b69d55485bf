"""A microscope to work with: verbs, what they bring back, and who carries them out. Needs no ROS.

`Microscope` has the words; `Local` is an instrument in this process, `Operator` does verbs with one that somebody else
runs.
"""

from .backend import Backend
from .jobs import Desk
from .labelled import labelled
from .local import Local
from .microscope import Microscope
from .operator import Operator
from .prepare import with_verbs
from .results import Calibration, Curve, Image, Line, Loop, Outcome, PathRecord, Progress, Record, Standing
from .verbs import (
    VERBS,
    Approach,
    CalibrateLateral,
    CalibrateSensitivity,
    ForceCurve,
    FrictionLoop,
    MoveTo,
    Scan,
    ScanPath,
    ThermalTune,
    Verb,
    Withdraw,
)

__all__ = [
    "VERBS",
    "Approach",
    "Backend",
    "CalibrateLateral",
    "CalibrateSensitivity",
    "Calibration",
    "Curve",
    "Desk",
    "ForceCurve",
    "FrictionLoop",
    "Image",
    "Line",
    "Local",
    "Loop",
    "Microscope",
    "MoveTo",
    "Operator",
    "Outcome",
    "PathRecord",
    "Progress",
    "Record",
    "Scan",
    "ScanPath",
    "Standing",
    "ThermalTune",
    "Verb",
    "Withdraw",
    "labelled",
    "with_verbs",
]
