"""Parts of the instrument, and what is needed to make one: docs/extending.md."""

from pydantic import Field

from ..core.jit import kernel
from ..core.records import Array, Integers, Record, Vector
from ..core.schema import Unit
from .dispatch import surface
from .groups import (
    DetectorParameters,
    FaultParameters,
    LawParameters,
    OnboardParameters,
    PiezoParameters,
    PlantParameters,
    ProgramParameters,
    SampleParameters,
)
from .loop import Onboard
from .part import Channel, Corrugation, Detector, Fault, Law, LawEstimate, Part, Piezo, Plant, Program, Sample

__all__ = [
    "Array",
    "Channel",
    "Corrugation",
    "Detector",
    "DetectorParameters",
    "Fault",
    "FaultParameters",
    "Field",
    "Integers",
    "Law",
    "LawEstimate",
    "LawParameters",
    "Onboard",
    "OnboardParameters",
    "Part",
    "Piezo",
    "PiezoParameters",
    "Plant",
    "PlantParameters",
    "Program",
    "ProgramParameters",
    "Record",
    "Sample",
    "SampleParameters",
    "Unit",
    "Vector",
    "kernel",
    "surface",
]
