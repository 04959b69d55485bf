"""Faults on request: the services, and the events at start and end of every fault."""

from bisect import bisect_left

from afm_msgs.srv import OrderFault
from rclpy.node import Node
from std_srvs.srv import Trigger

from afm_model.core.errors import ParameterError
from afm_model.fault import NEVER, Entry, events, faults_of
from afm_model.run import OVER, Run
from afm_node_common import topics
from afm_node_common.parameters import Declared
from afm_node_common.process import SimNodeParameters

from .event_topic import Events


class FaultServer:
    """Takes orders between two ticks, and publishes events.

    What is ordered becomes a parameter of the node, so that it is recorded, and happens again after a reset.

    Parameters
    ----------
    node : Node
    run : Run
    declared : Declared
        The parameters of the node.
    events : Events
    """

    def __init__(self, node: Node, run: Run, declared: Declared[SimNodeParameters], events: Events) -> None:
        self._run, self._declared, self._publish = run, declared, events.publish
        self._log = node.get_logger()
        self._told = 0
        self._known: SimNodeParameters | None = None
        self._events: list[tuple[int, str]] = []
        node.create_service(OrderFault, topics.ORDER_FAULT, self._order)
        node.create_service(Trigger, topics.CLEAR_FAULTS, self._clear)

    def look(self) -> None:
        """Publish the events since the last call."""
        ticks = self._run.instrument.ticks
        if ticks < self._told:
            self._told = 0
        if self._run.instrument.has_faults:
            for tick, text in self._happened(self._told, ticks):
                # Not in one line: rclpy allows one severity for each.
                if ends := text.endswith(" ends"):
                    self._log.info(text)
                else:
                    self._log.warning(text)
                self._publish(self._run.run_id, tick, round(tick * self._period * 1e9), text, warn=not ends)
        self._told = ticks

    def _happened(self, begin: int, end: int) -> list[tuple[int, str]]:
        """Events from tick `begin` up to `end`; looked for 50 times a second, among all faults of a long life."""
        if self._known is not self._declared.current:
            self._known = self._declared.current
            self._events = events(self._known, 0, NEVER)
        return self._events[bisect_left(self._events, (begin,)) : bisect_left(self._events, (end,))]

    @property
    def _period(self) -> float:
        return self._declared.current.plant.control_period

    @property
    def _next(self) -> int:
        """First tick whose measurement has not been published."""
        return self._run.instrument.ticks + 1

    def _order(self, request: OrderFault.Request, response: OrderFault.Response) -> OrderFault.Response:
        faults = faults_of(self._declared.current)
        name = request.name or next(name for i in range(len(faults) + 1) if (name := f"ordered_{i + 1}") not in faults)
        try:
            response.tick = self._put_in_force(name, request)
        except ParameterError as error:
            response.message = str(error)
            return response
        entry = faults_of(self._declared.current)[name]
        response.success, response.name = True, name
        response.message = f"fault {name}, {entry.describe()}, begins at tick {response.tick} ({entry.start:.9g} s)"
        return response

    def _put_in_force(self, name: str, request: OrderFault.Request) -> int:
        """First tick of the fault ordered."""
        if self._run.state in OVER:
            raise ParameterError("the run is over: call reset first")
        if name in faults_of(self._declared.current):
            raise ParameterError(f"fault.{name} exists already: give another name")
        earliest = self._next * self._period
        if 0.0 <= request.start < earliest - 0.5 * self._period:
            raise ParameterError(
                f"fault.{name}.start = {request.start:g} s is not allowed: the run is at "
                f"{self._run.instrument.time:g} s; it must be >= {earliest:.9g} s, or negative for the next measurement"
            )
        values = {field: getattr(request, field) for field in Entry.model_fields}
        values["start"] = earliest if request.start < 0.0 else request.start
        self._enter({f"fault.{name}.{field}": value for field, value in values.items()})
        return faults_of(self._declared.current)[name].ticks(self._period)[0]

    def _enter(self, values: dict[str, object]) -> None:
        if (kind := self._declared.current.fault.kind) != "scheduled":
            raise ParameterError(f"fault.kind = {kind} takes no orders: start the simulator with fault.kind:=scheduled")
        self._run.adapt(self._declared.enter(values))  # type: ignore[arg-type]

    def _clear(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """End every fault, those that have not begun before they begin."""
        values: dict[str, object] = {}
        for name, entry in faults_of(self._declared.current).items():
            if entry.ticks(self._period)[1] > self._next:
                values[f"fault.{name}.duration"] = max(self._next * self._period - entry.start, 0.0)
        try:
            if values:
                self._enter(values)
        except ParameterError as error:
            response.message = str(error)
            return response
        response.success = True
        ended = f"faults ended: {len(values)}, at tick {self._next}"
        response.message = ended if values else "no fault was left to end"
        return response
