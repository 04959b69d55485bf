"""Friction-predicting control, docs/laws.md: a law that knows that friction sticks, and acts before it does."""

from ...parts.part import Law
from .constants import Constants, values
from .control import control
from .limits import check, warnings
from .parameters import PredictiveLaw
from .state import State, start

PREDICTIVE = Law(
    name="predictive",
    parameters=PredictiveLaw,
    constants=Constants,
    state=State,
    values=values,
    start=start,
    check=check,
    warnings=warnings,
    control=control,
)

__all__ = ["PREDICTIVE", "PredictiveLaw"]
