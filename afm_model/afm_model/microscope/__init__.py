"""A microscope to work with: verbs, what they bring back, and who carries them out. Needs no ROS.

`Microscope` has the words; `Local` is an instrument in this process, `Operator` does verbs with one that somebody else
runs.
"""

from .arrays import Arrays, Variable, to_xarray, variable
from .backend import Backend
from .execution import Execution, Task
from .image import Image, Line
from .live_local import Live
from .local import Local
from .microscope import Microscope
from .operator import Operator
from .prepare import with_verbs
from .results import Calibration, MicroscopeState, Outcome, Progress, Standing, TimeSeries
from .verb import Verb, all_verbs
from .verbs import (
    AmplitudeCurve,
    Approach,
    CalibrateLateral,
    CalibrateSensitivity,
    ContactResonance,
    ForceCurve,
    FrictionLoop,
    Hold,
    Lift,
    MoveTo,
    MoveZ,
    Read,
    Scan,
    ScanPath,
    ThermalTune,
    Tune,
    Withdraw,
)
from .verbs.force_curve import Curve
from .verbs.friction_loop import Loop
from .verbs.scan_path import PathRecord
from .view import InstrumentView

__all__ = [
    "AmplitudeCurve",
    "Approach",
    "Arrays",
    "Backend",
    "CalibrateLateral",
    "CalibrateSensitivity",
    "Calibration",
    "ContactResonance",
    "Curve",
    "Execution",
    "ForceCurve",
    "FrictionLoop",
    "Hold",
    "Image",
    "InstrumentView",
    "Lift",
    "Line",
    "Live",
    "Local",
    "Loop",
    "Microscope",
    "MicroscopeState",
    "MoveTo",
    "MoveZ",
    "Operator",
    "Outcome",
    "PathRecord",
    "Progress",
    "Read",
    "Scan",
    "ScanPath",
    "Standing",
    "Task",
    "ThermalTune",
    "TimeSeries",
    "Tune",
    "Variable",
    "Verb",
    "Withdraw",
    "all_verbs",
    "to_xarray",
    "variable",
    "with_verbs",
]
