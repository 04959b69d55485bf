"""Constants and state of the friction-predicting law, to ask one of its parts."""

from typing import Any

from afm_model import ControllerParameters, build, simulate
from afm_model.law.predictive.guard import begin_anew
from afm_model.law.predictive.predictive_constants import Constants, values
from afm_model.law.predictive.predictive_state import State, start
from afm_model.studies.contender import contender
from afm_model.studies.wrong_models import CASE, RATES, parameters_of

from ..tables import record_of


def records(**law: object) -> tuple[Any, Any]:
    """Constants and state, as they are at the first measurement, with these parameters of the law."""
    parameters = build(ControllerParameters, {"law.kind": "predictive", **{f"law.{k}": v for k, v in law.items()}})
    p, s = record_of(Constants, **values(parameters)), record_of(State, **start(parameters))
    begin_anew(p, s)
    return p, s


def estimates(title: str, rate: int, surface: str, seed: int = 0) -> Any:
    """What the law believes in a run of a case of wrong models with positions alone and noise."""
    law = contender(f"predictive surface={surface}")
    return simulate(*parameters_of(CASE[title], RATES[rate], law, 1.0, seed)).estimates
