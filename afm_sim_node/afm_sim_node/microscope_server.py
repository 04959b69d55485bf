"""The microscope on topics: verbs as actions, settings as services, what it is doing, and scans line by line."""

from collections.abc import Callable
from typing import Any

from afm_msgs.msg import MicroscopeStatus
from rclpy.node import Node

from afm_model import Instrument
from afm_model.microscope.image import Line
from afm_model.microscope.operator import Operator
from afm_model.microscope.results import Outcome
from afm_model.microscope.verb import Verb
from afm_model.microscope.verbs import Scan
from afm_model.run import Run
from afm_node_common import topics
from afm_node_common.parameters import Declared
from afm_node_common.periodic_tasks import PeriodicTask
from afm_node_common.process import SimNodeParameters
from afm_node_common.stamps import stamp

from .event_topic import Events
from .result_topic import Results
from .scan_lines import ScanLines
from .setting_services import SettingsServer, setpoint
from .verb_server import VerbServer

_LOOK_PERIOD = 0.2
_IMAGES_PERIOD = 0.05
"""Wall time between two looks at the images [s]: at each one at most is published."""


def operator_of(on_line: Callable[[Line], object], instrument: Instrument) -> Operator:
    """Return the operator of an instrument, which calls `on_line` with every line of a scan."""
    operator = Operator(instrument)
    operator.on_line = on_line  # type: ignore[assignment]
    return operator


class MicroscopeServer:
    """Serves verbs and settings, and reports what is being done.

    Parameters
    ----------
    node : Node
    run : Run
        Its operator was made by `operator_of`; its listener `verb_over` calls `verb_over`.
    declared : Declared
        The parameters of the node: what is set or put in stands there, and is recorded.
    events : Events
    """

    def __init__(
        self,
        node: Node,
        run: Run,
        declared: Declared[SimNodeParameters],
        events: Events,
    ) -> None:
        self._run, self._declared = run, declared
        self._lines, results = ScanLines(node), Results(node)
        self._status = node.create_publisher(MicroscopeStatus, topics.MICROSCOPE, topics.LATCHED_QOS)
        self._told: Any = None

        def changed(event: str, warn: bool) -> None:
            events.publish(run.run_id, run.instrument.ticks, run.stamp_ns, event, warn=warn)
            self.publish()

        def brought(verb: str, outcome: Outcome) -> None:
            results.publish(run.run_id, verb, outcome, run.stamp_ns)

        self._verbs = VerbServer(node, run, self._begun, changed, brought)
        SettingsServer(node, run, self._exchange, self._on_setting)
        self.publish()

    @property
    def tasks(self) -> tuple[PeriodicTask, ...]:
        """What is to be done now and then."""
        return (
            PeriodicTask(self._verbs.look, _LOOK_PERIOD),
            PeriodicTask(self.publish, _LOOK_PERIOD),
            PeriodicTask(self._lines.publish_images, _IMAGES_PERIOD),
        )

    def finish(self, spin_once: Callable[[float], None]) -> None:
        """End what is being done, and answer its goal."""
        operator = self._run.operator
        if operator.busy:
            operator.give_up("the simulator was ended")
            self.verb_over(operator.outcome())
        self._verbs.finish(spin_once)

    def close(self) -> None:
        """Let the node be destroyed."""
        self._verbs.close()

    def put_line(self, line: Line) -> None:
        """A line of a scan has been measured."""
        self._lines.put(self._run.run_id, line, self._run.operator.measured)

    def verb_over(self, outcome: Outcome) -> None:
        """A verb has come to its end."""
        self._lines.end()
        if self._run.instrument.parameters.onboard != self._declared.current.onboard:
            self._on_setting()
        self._verbs.verb_over(outcome)

    def _begun(self, verb: Verb) -> None:
        if isinstance(verb, Scan):
            self._lines.begin()
            self._verbs.scan = self._lines.number

    def _exchange(self, group: str, changes: dict[str, Any]) -> None:
        """Put in another sample or probe; raises ParameterError or VerbError."""
        from afm_model.microscope.local import exchanged

        made = exchanged(self._declared.current, self._run.operator.state, group, changes)
        self._run.exchange(made)
        self._declared.exchange(made)

    def _on_setting(self) -> None:
        """The loop inside was set by a service or a verb, or calibrations put in use."""
        parameters = self._run.instrument.parameters
        news = {group: getattr(parameters, group) for group in ("onboard", "calibration")}
        self._declared.exchange(self._declared.current.model_copy(update=news))
        self.publish()

    def publish(self) -> None:
        """Publish what the microscope is doing, if that has changed."""
        operator = self._run.operator
        state, progress = operator.state, operator.progress
        volts, force = setpoint(self._run)
        message = MicroscopeStatus(
            run_id=self._run.run_id,
            approached=state.approached,
            feedback=state.feedback,
            setpoint_voltage=volts,
            setpoint_force=force,
            proportional_gain=state.proportional_gain,
            integral_gain=state.integral_gain,
            x=state.place[0],
            y=state.place[1],
            doing=state.doing,
            progress=float(progress.fraction) if state.doing else 0.0,
            detail=progress.detail if state.doing else "",
            last=self._verbs.last,
        )
        if repr(message) == self._told:
            return
        self._told = repr(message)
        message.header.frame_id = topics.FRAME
        message.header.stamp = stamp(self._run.stamp_ns)
        self._status.publish(message)
