"""Parameters of the model, declared once with unit, bounds, default and description."""

from .controller import ControllerParameters, Law
from .instrument import Detector, InstrumentParameters, Plant, Reference, Score, stable_step
from .physics import Cantilever, Contact, Physics, Piezo, Sample, Scales, Scanner
from .run import Process, Run, SimParameters
from .schema import (
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

__all__ = [
    "Cantilever",
    "Contact",
    "ControllerParameters",
    "Detector",
    "Group",
    "InstrumentParameters",
    "Law",
    "NonNegative",
    "Physics",
    "Piezo",
    "Plant",
    "Positive",
    "Process",
    "Reference",
    "Run",
    "Sample",
    "Scales",
    "Scanner",
    "Score",
    "SimParameters",
    "Specification",
    "Unit",
    "Value",
    "build",
    "flatten",
    "specifications",
    "stable_step",
    "unknown_name_message",
]
