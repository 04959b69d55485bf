"""Constants and state of the friction-predicting law, to ask one of its parts."""

from typing import Any

from afm_model import ControllerParameters, build
from afm_model.law.predictive.guard import begin_anew
from afm_model.law.predictive.predictive_constants import Constants, values
from afm_model.law.predictive.predictive_state import State, start

from ..tables import record_of


def records(**law: object) -> tuple[Any, Any]:
    """Constants and state, as they are at the first measurement, with these parameters of the law."""
    parameters = build(ControllerParameters, {"law.kind": "predictive", **{f"law.{k}": v for k, v in law.items()}})
    p, s = record_of(Constants, **values(parameters)), record_of(State, **start(parameters))
    begin_anew(p, s)
    return p, s
