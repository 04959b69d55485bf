"""Publishes reports of a run: status, diagnostics, score."""

import time

from afm_msgs.msg import InstrumentStatus, Score
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from rclpy.node import Node

from afm_model.run import Run, RunState, Snapshot, warnings
from afm_node_common import topics
from afm_node_common.process import SimNodeParameters

from .diagnostics import diagnostic_status
from .inside_link import InsideLink
from .log_messages import log_refusal, log_state, log_warnings
from .peers import Peers
from .score_message import score_message
from .standing import StandingSubscribers
from .status import status_message
from .streams import Streams
from .topic_link import TopicLink


class Reporter:
    """Looks at a run now and then, and at every change of its state.

    Parameters
    ----------
    node : Node
    run : Run
    link : TopicLink or InsideLink
    peers : Peers
    streams : Streams
    parameters : SimNodeParameters
    """

    def __init__(
        self,
        node: Node,
        run: Run,
        link: TopicLink | InsideLink,
        peers: Peers,
        streams: Streams,
        parameters: SimNodeParameters,
    ) -> None:
        self._run, self._link, self._peers, self._streams = run, link, peers, streams
        self._parameters = parameters
        self._name = node.get_fully_qualified_name()
        self._now = node.get_clock().now
        self._log = node.get_logger()
        self._status = node.create_publisher(InstrumentStatus, topics.STATUS, topics.LATCHED_QOS)
        self._score = node.create_publisher(Score, topics.SCORE, topics.LATCHED_QOS)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._composed = DiagnosticArray()
        self._standing, self._told = StandingSubscribers(node, topics.MEASUREMENT), ""
        self._before = self._logged = run.snapshot()
        self._warnings: list[str] = []
        self._recorders = 0

    def state_changed(self) -> None:
        """Log and publish the state, if it is another one."""
        run = self._run.snapshot()
        if (run.state, run.detail) != (self._logged.state, self._logged.detail):
            self.log_state()
        if run.state in (RunState.WAITING, RunState.FAULT):
            # The counts begin again, or the cause of the warning is over.
            self._before, self._warnings = run, []
        self.publish_status()

    def log_state(self) -> None:
        """Log the state."""
        run = self._run.snapshot()
        log_state(self._log, run, self._parameters)
        self._logged = run

    def publish_status(self, *, over: bool = False) -> None:
        """Publish InstrumentStatus; `over`: the last one of its run."""
        recorders = self._streams.subscribers
        if recorders != self._recorders:
            self._log.info(
                f"{'a recorder has come' if recorders > self._recorders else 'a recorder has gone'}: "
                f"{recorders} receive every stream"
            )
            self._recorders = recorders
        self._status.publish(
            status_message(
                self._run.snapshot(),
                self._parameters,
                controllers=self._link.controllers,
                recorders=recorders,
                warning="; ".join(self._warnings),
                over=over,
            )
        )

    def look_at_subscribers(self) -> None:
        """Note subscribers of the loop's topic that stand still, and log a change."""
        told, self._told = self._told, self._standing.look()
        if self._told and self._told != told:
            self._log.warning(self._told)

    def compose_diagnostics(self) -> None:
        """Write the same and more for ordinary tools. Publishing is another task: a tick waits for one at most."""
        run = self._run.snapshot()
        self._compare(run)
        entry = diagnostic_status(self._name, run, self._run.delays(), self._warnings, self._link.fast_path)
        self._composed = DiagnosticArray(status=[entry])
        self._composed.header.stamp = self._now().to_msg()

    def _compare(self, run: Snapshot) -> None:
        """What went wrong since the last time."""
        before, self._before = self._before, run
        log_refusal(self._log, before, run)
        self._warnings = warnings(before, run, self._link.cause)
        log_warnings(self._log, self._warnings)
        if run.state == RunState.RUNNING and len(self._peers.controllers) > 1:
            self._warnings.insert(0, f"{self._peers.controller} publish piezo_drive")
        if run.state != RunState.WAITING and self._peers.incompatible:
            self._warnings.insert(0, self._peers.incompatible)
        if self._told:
            self._warnings.append(self._told)
        if run.state in (RunState.STALLED, RunState.RETRACTED) and (silent := self._peers.silent()):
            self._warnings.append(silent)

    def wait_for_delivery(self, timeout: float) -> None:
        """Wait until everybody has the score and the last status, at most `timeout` seconds of wall time."""
        limit = time.monotonic() + timeout
        for publisher in (self._score, self._status):
            publisher.wait_for_all_acked(Duration(seconds=max(limit - time.monotonic(), 0.0)))

    def publish_diagnostics(self) -> None:
        """Publish the composed diagnostics."""
        self._diagnostics.publish(self._composed)

    def publish_score(self) -> None:
        """Publish the score of the run, which is over."""
        run, instrument = self._run.snapshot(), self._run.instrument
        self._compare(run)
        score = score_message(
            instrument.score(),
            run,
            self._run.delays(),
            self._parameters,
            instrument.trajectory_sha256(),
            self._link.cause,
        )
        for sentence in filter(None, (score.reason, score.warning)):
            self._log.warning(sentence)
        self._score.publish(score)
