"""Services between two ticks: settings of the microscope, its signals, another sample or probe, the stop of a verb."""

import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

from afm_msgs.srv import Exchange, ReadSignals, SetFeedback, SetGains, SetSetpoint
from rclpy.node import Node
from std_srvs.srv import Trigger

from afm_model.core.errors import ParameterError, VerbError
from afm_model.onboard.by_amplitude import taps
from afm_model.run import Run
from afm_node_common import topics
from afm_node_common.barrier import sentence
from afm_node_common.decoding import values_of

_SETPOINTS = ("force", "voltage", "amplitude", "share")
Exchanging = Callable[[str, dict[str, Any]], None]
"""exchange(group, changes): another sample or plant; raises ParameterError or VerbError."""


class SettingsServer:
    """Serves them.

    Parameters
    ----------
    node : Node
    run : Run
        With an operator.
    exchange : Exchanging
    changed : callable
        changed(): something was set.
    """

    def __init__(self, node: Node, run: Run, exchange: Exchanging, changed: Callable[[], object]) -> None:
        self._run, self._exchange, self._changed = run, exchange, changed
        node.create_service(SetSetpoint, topics.SET_SETPOINT, self._set_setpoint)
        node.create_service(SetGains, topics.SET_GAINS, self._set_gains)
        node.create_service(SetFeedback, topics.SET_FEEDBACK, self._set_feedback)
        node.create_service(Exchange, topics.SET_CALIBRATION, self._set_calibration)
        node.create_service(Exchange, topics.SET_Z_LIMITS, self._set_z_limits)
        node.create_service(ReadSignals, topics.READ_SIGNALS, self._read_signals)
        node.create_service(Trigger, topics.STOP_VERB, self._stop_verb)
        for topic, group in ((topics.SET_SAMPLE, "sample"), (topics.SET_PROBE, "plant")):
            node.create_service(Exchange, topic, partial(self._exchange_part, group))

    def _try(self, change: Callable[[], object], response: Any) -> Any:
        try:
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                change()
            response.message = "; ".join(str(each.message) for each in told)
        except (ParameterError, VerbError) as error:
            response.message = sentence(error)
        else:
            response.success = True
            self._changed()
        return response

    def _set_setpoint(self, request: Any, response: Any) -> Any:
        given = {name: each for name in _SETPOINTS if (each := getattr(request, name)) != 0.0} or {"force": 0.0}
        self._try(partial(self._run.operator.set_setpoint, **given), response)
        response.voltage, response.force = setpoint(self._run)
        return response

    def _set_gains(self, request: Any, response: Any) -> Any:
        given = [None if value < 0.0 else value for value in (request.proportional, request.integral)]
        return self._try(partial(self._run.operator.set_gains, *given), response)

    def _set_feedback(self, request: Any, response: Any) -> Any:
        return self._try(partial(self._run.operator.set_feedback, request.mode), response)

    def _set_calibration(self, request: Any, response: Any) -> Any:
        return self._try(lambda: self._run.operator.use(**values_of(request.parameters)), response)

    def _set_z_limits(self, request: Any, response: Any) -> Any:
        def change() -> None:
            limits = values_of(request.parameters)
            if unknown := [name for name in limits if name not in ("low", "high")]:
                raise ParameterError(f"{unknown[0]} is not a limit of z: there are low, high")
            self._run.operator.set_z_limits(**limits)

        return self._try(change, response)

    def _read_signals(self, request: Any, response: Any) -> Any:
        try:
            read = self._run.operator.read_signals(*request.names)
        except ParameterError as error:
            response.message = sentence(error)
            return response
        response.success, response.read = True, list(read)
        response.values, response.units = [each.value for each in read.values()], [each.unit for each in read.values()]
        return response

    def _stop_verb(self, request: Any, response: Any) -> Any:
        operator = self._run.operator
        response.success = bool(operator.busy)
        if operator.busy:
            operator.cancel("stopped", stay=True)
        else:
            response.message = "nothing is being done: there is nothing to stop"
        return response

    def _exchange_part(self, group: str, request: Any, response: Any) -> Any:
        def change() -> None:
            self._exchange(group, values_of(request.parameters))

        return self._try(change, response)


def setpoint(run: Run) -> tuple[float, float]:
    """In force now: [V], and as vertical force [N]; NaN: not known."""
    volts = float(run.operator.state.setpoint)
    parameters = run.instrument.parameters
    known = parameters.plant.spring_constant(parameters) != 0.0 and not taps(parameters)
    return volts, volts / parameters.plant.deflection_voltage(parameters, 1.0) if known else float("nan")
