"""Constants and state of the friction-predicting law, to ask one of its parts."""

from collections.abc import Callable, Iterator
from typing import Any

from model.tables import record_of

from afm_model import Controller, ControllerParameters, Instrument, SimParameters, build, simulate
from afm_model.compiled.records import record_at
from afm_model.parts.signals import Measurement
from afm_model.studies.contender import contender
from afm_model.studies.wrong_models import CASE, RATES, parameters_of
from afm_predictive.constants import Constants, values
from afm_predictive.guard import begin_anew
from afm_predictive.state import State, start


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


def along(
    reference: Callable[[int], tuple[float, float, float]], ticks: int, sim: SimParameters, told: ControllerParameters
) -> Iterator[tuple[Any, Any, Controller]]:
    """A run along a reference of one's own, position, rate and acceleration of x and y at a tick.

    Measurement and truth of each tick, and the law that has answered them.
    """
    instrument, law = Instrument(sim, ticks), Controller(told)
    for tick in range(ticks):
        measurement = instrument.measurement.copy()
        y = record_at(measurement, 0, Measurement)
        y.reference_position[:2], y.reference_velocity[:2], y.reference_acceleration[:2] = reference(tick)
        drive = law.answer(measurement, tick * sim.plant.control_period)
        yield y, instrument.truth, law
        instrument.tick(drive, tick)
