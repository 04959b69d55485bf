"""Parameters, declared once with unit, bounds, default and description: the trees of instrument, run and controller.

The parameters of a part stand in its own file; the trees here hold those of the parts that are chosen by default.
"""

from ..core.changes import changed
from ..core.schema import (
    Group,
    NonNegative,
    Positive,
    Specification,
    Unit,
    Value,
    build,
    flatten,
    specifications,
    unknown_name_message,
)
from ..plant import stable_step
from ..plant.physics import Cantilever, Contact, PlantPhysics, Scales, Scanner, Units
from .instrument_parameters import ControllerParameters, Drift, InstrumentParameters, Score
from .microscope_parameters import SetupSection, resolved
from .simulator_parameters import RunParameters, Safety, SimParameters

__all__ = [
    "Cantilever",
    "Contact",
    "ControllerParameters",
    "Drift",
    "Group",
    "InstrumentParameters",
    "NonNegative",
    "PlantPhysics",
    "Positive",
    "RunParameters",
    "Safety",
    "Scales",
    "Scanner",
    "Score",
    "SetupSection",
    "SimParameters",
    "Specification",
    "Unit",
    "Units",
    "Value",
    "build",
    "changed",
    "flatten",
    "resolved",
    "specifications",
    "stable_step",
    "unknown_name_message",
]
