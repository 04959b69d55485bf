"""Types of the fields of verbs: quantities with their units and bounds."""

from typing import Annotated

from annotated_types import Ge, Le

from ..core.schema import NonNegative, Positive, Unit

Metre = Annotated[float, Unit("m")]
Length = Annotated[Positive, Unit("m")]
Speed = Annotated[float, Ge(1e-12), Le(1.0), Unit("m/s")]
Rest = Annotated[float, Ge(0), Le(1e4), Unit("s")]
Angle = Annotated[float, Unit("rad")]
Volts = Annotated[NonNegative, Unit("V")]
Rate = Annotated[Positive, Unit("Hz")]
Force = Annotated[NonNegative, Unit("N")]
Count = Annotated[int, Ge(1), Le(1_000_000)]
LineCount = Annotated[int, Ge(1), Le(8192)]
SampleRate = Annotated[float, Ge(1e-3), Le(1e9), Unit("Hz")]
Places = Annotated[tuple[float, ...], Unit("m")]
