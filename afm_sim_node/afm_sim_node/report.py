"""What the simulator tells about itself: status, score, diagnostics."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from afm_msgs.msg import InstrumentStatus, Score
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.qos import ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from afm_node_common import topics

from .streams import stamp
from .timing import Histogram

if TYPE_CHECKING:
    from .node import SimNode

_LEVEL = {
    InstrumentStatus.STALLED: DiagnosticStatus.WARN,
    InstrumentStatus.RETRACTED: DiagnosticStatus.WARN,
    InstrumentStatus.FAULT: DiagnosticStatus.ERROR,
}
_NAMES = {
    InstrumentStatus.WAITING: "waiting",
    InstrumentStatus.RUNNING: "running",
    InstrumentStatus.PAUSED: "paused",
    InstrumentStatus.STALLED: "stalled",
    InstrumentStatus.RETRACTED: "retracted",
    InstrumentStatus.FINISHED: "finished",
    InstrumentStatus.FAULT: "fault",
}


def _show(histogram: Histogram) -> str:
    return ", ".join(f"{value:.3g}" for value in histogram.summary)


def _names(infos: Sequence[TopicEndpointInfo]) -> list[str]:
    """Full names of the nodes of these ends of a topic."""
    names = {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos}
    # Until a node has told who it is, the middleware gives names of its own.
    return sorted(name for name in names if "_UNKNOWN_" not in name)


class Reporter:
    """Builds and publishes the messages about a run."""

    def __init__(self, node: "SimNode") -> None:
        self._node = node
        self._status = node.create_publisher(InstrumentStatus, topics.STATUS, topics.LATCHED_QOS)
        self._score = node.create_publisher(Score, topics.SCORE, topics.LATCHED_QOS)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._composed = DiagnosticArray()
        self._controllers = 0
        self._before = (0, 0)  # ticks and lost drives at the diagnostics before
        self._names: list[str] = []

    @property
    def controller(self) -> str:
        """Full name of the node that publishes drives, or of all that do."""
        return " and ".join(self._names)

    def look_for_controller(self, *, force: bool = False) -> None:
        """Find out who publishes drives, if their number has changed or with `force`."""
        node = self._node
        # Asking for names takes a while; asking how many does not.
        if self._controllers == node.inbox.publishers and not force:
            return
        self._controllers = node.inbox.publishers
        infos = node.get_publishers_info_by_topic(node.resolve_topic_name(topics.PIEZO_DRIVE))
        unheard = [info for info in infos if info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT]
        before, self._names = self._names, _names([info for info in infos if info not in unheard])
        if len(self._names) > 1 and self._names != before:
            node.get_logger().warning(f"{self.controller} publish piezo_drive: each answers, the drives get mixed")
        if node.state == InstrumentStatus.WAITING:
            detail = (
                f"{' and '.join(_names(unheard))} publishes piezo_drive best effort: it must be reliable"
                if unheard
                else ""
            )
            if detail != node.detail:
                node.set_state(InstrumentStatus.WAITING, detail)

    def log_state(self) -> None:
        """Tell a person at the terminal about a change of state."""
        node = self._node
        log = node.get_logger()
        if node.state == InstrumentStatus.FAULT:
            log.error(node.detail)
        elif node.detail:
            log.warning(node.detail)
        elif node.state == InstrumentStatus.WAITING:
            run = node.parameters.run
            others = [
                *(["a recorder"] if run.wait_for_recorder else []),
                *(["the play service"] if run.start_paused else []),
            ]
            log.info(f"waiting for {' and '.join(['a controller', *others])}")
        elif node.state == InstrumentStatus.FINISHED:
            log.info(f"finished: {node.instrument.ticks} ticks, {node.instrument.time:.6g} s simulated")
        else:
            log.info(_NAMES[node.state])

    @property
    def _real_time_factor(self) -> float:
        """Simulated over wall time of the run up to now."""
        elapsed = self._node.watch.elapsed
        return self._node.instrument.time / elapsed if elapsed > 0.0 else 0.0

    def publish_status(self) -> None:
        """Publish InstrumentStatus."""
        node = self._node
        instrument, parameters = node.instrument, node.parameters
        status = InstrumentStatus(
            state=node.state,
            detail=node.detail,
            plant=parameters.plant.kind,
            mode=parameters.run.mode,
            controller=self.controller,
            recorders=node.streams.subscribers,
            control_period=parameters.plant.control_period,
            duration=parameters.run.duration,
            ticks=instrument.ticks,
            samples=instrument.ticks * instrument.samples_per_tick,
            real_time_factor=self._real_time_factor,
            drives_lost=node.drives_lost,
            drives_refused=node.drives_refused,
            late_ticks=node.late_ticks,
            periods_missed=node.periods_missed,
            in_contact=instrument.in_contact,
        )
        status.header.frame_id = topics.FRAME
        status.header.stamp = stamp(node.stamp_ns)
        self._status.publish(status)

    def compose_diagnostics(self) -> None:
        """Write the same and more for ordinary tools. Publishing is another chore: a tick waits for one at most."""
        node = self._node
        level, message = _LEVEL.get(node.state, DiagnosticStatus.OK), node.detail or _NAMES[node.state]
        ticks, lost = node.instrument.ticks - self._before[0], node.drives_lost - self._before[1]
        self._before = (node.instrument.ticks, node.drives_lost)
        if node.state == InstrumentStatus.RUNNING:
            if len(self._names) > 1:
                level, message = DiagnosticStatus.WARN, f"running; {self.controller} publish piezo_drive"
            elif ticks > 0 and lost > 0.5 * ticks:
                level = DiagnosticStatus.WARN
                message = f"running; {lost} of the last {ticks} ticks had no new drive and held an older one"
        entry = DiagnosticStatus(
            level=level,
            name=f"{node.get_fully_qualified_name()}: instrument",
            message=message,
            hardware_id="virtual AFM",
        )
        values = {
            "ticks": node.instrument.ticks,
            "real-time factor": f"{self._real_time_factor:.4g}",
            "round trip p50, p99, p99.9, max [s]": _show(node.round_trips),
            "lateness p50, p99, p99.9, max [s]": _show(node.lateness),
            "command age p50, p99, p99.9, max [s]": _show(node.command_ages),
            "drives lost": node.drives_lost,
            "drives refused": node.drives_refused,
            "late ticks": node.late_ticks,
            "periods missed": node.periods_missed,
            "ticks retracted": node.ticks_retracted,
            **node.fast_path,
        }
        entry.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        self._composed = DiagnosticArray(status=[entry])
        self._composed.header.stamp = node.get_clock().now().to_msg()

    def publish_diagnostics(self) -> None:
        """Publish what was composed."""
        self._diagnostics.publish(self._composed)

    def publish_score(self) -> None:
        """Publish the score of the run up to now."""
        node = self._node
        instrument = node.instrument
        summary = instrument.score()
        score = Score(
            start=node.parameters.score_start,
            **vars(summary),
            simulated=instrument.time,
            wall=node.watch.elapsed,
            round_trip=node.round_trips.summary,
            lateness=node.lateness.summary,
            command_age=node.command_ages.summary,
            late_ticks=node.late_ticks,
            periods_missed=node.periods_missed,
            ticks_retracted=node.ticks_retracted,
            trajectory_sha256=instrument.trajectory_sha256(),
        )
        score.header.frame_id = topics.FRAME
        score.header.stamp = stamp(node.stamp_ns)
        self._score.publish(score)
