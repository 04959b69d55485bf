"""Friction-predicting control, docs/predictive.md: a law that knows that friction sticks, and acts before it does."""

from afm_model.parts import Law

from .constants import ANSWERS, Constants, longest, values
from .control import control
from .law import PredictiveLaw, check, estimates, remark, warnings
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
    remark=remark,
    estimates=estimates,
    control=control,
    knowledge="positions and velocities of the scanner, deflection, lateral force (feedback=measured: no velocities); "
    "scanner, cantilever, contact, its friction; of the sample its shortest wave and height (surface=known: all); "
    "noise of the sensors",
    models_contact=True,
    memory=("sent", lambda parameters: 3 * ANSWERS * longest(parameters)),
)

__all__ = ["PREDICTIVE", "PredictiveLaw"]
