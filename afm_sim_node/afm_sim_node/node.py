"""The simulator node: a run of the instrument on topics, with services, streams and reports."""

import gc
import signal
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from afm_model import Block
from afm_model.parameters.simulator_parameters import is_inside
from afm_model.run import OVER, Listeners, Run, RunState
from afm_node_common import runner, topics
from afm_node_common.estimates import Estimates
from afm_node_common.heap import give_back
from afm_node_common.parameter_log import ParameterLog
from afm_node_common.periodic_tasks import PeriodicTask, PeriodicTasks
from afm_node_common.preview_service import PreviewServer
from afm_node_common.process import SimNodeParameters

from .clock import Clock
from .declared import block_ticks, declare, takes_verbs
from .event_topic import Events
from .fault_services import FaultServer
from .idle import Idle
from .inside_link import InsideLink
from .log_messages import log_timing
from .peers import Peers
from .recorder_watch import RecorderWatch
from .reporter import Reporter
from .run_services import Control
from .standard import INSTALLED, Standard
from .streams import Streams
from .telemetry import Telemetry
from .topic_link import TopicLink

if TYPE_CHECKING:
    from afm_model.microscope.image import Line
    from afm_model.microscope.results import Outcome

    from .microscope_server import MicroscopeServer

_STATUS_PERIOD = 0.2
_DELIVERY_TIMEOUT, _LEFT_TIMEOUT = 5.0, 0.2
_DIAGNOSTICS_PERIOD = 1.0


class SimNode(Node):
    """The virtual instrument on topics. `step` and `wait` are called by `afm_node_common.runner`."""

    def __init__(self) -> None:
        super().__init__("afm_sim_node", namespace=topics.NAMESPACE)
        self._declared = declared = declare(self, self._on_parameters)
        parameters = declared.current
        self.process = parameters.process
        self.exit_code = 0
        inside = is_inside(parameters.law)
        self._peers = Peers(self, law_inside=inside)
        make_link = InsideLink if inside else TopicLink
        self._link = make_link(self, parameters, self._peers, recorders=lambda: self._streams.subscribers)
        self._microscope: MicroscopeServer | None = None
        operate = None
        if takes_verbs(parameters):
            # Here: whoever orders no verbs need not wait for them to be imported.
            from . import microscope_server

            operate = partial(microscope_server.operator_of, self._on_line)
        self.run = Run(
            parameters,
            self._link,
            time.monotonic,
            Listeners(
                changed=self._on_state,
                block=self._on_block,
                ended=self._on_end,
                left=self._on_left,
                verb_over=self._on_verb_over,
            ),
            block_ticks=block_ticks(parameters),
            operate=operate,
            in_pieces=parameters.run.mode == "realtime",
        )
        """The life of the instrument."""
        self.step = self.run.step
        self._streams = Streams(self, parameters, self.run.instrument.channels)
        self.wait = Idle(self.run, self._link, self._streams, declared).wait
        self.run.warm_up()
        self._telemetry = Telemetry(self, self.run)
        self.estimates = Estimates(self, lambda: law.estimates if (law := self.run.pacing.law) is not None else ())
        """What a law inside believes, on topics."""
        self._reporter = Reporter(self, self.run, self._link, self._peers, self._streams, parameters)
        in_lockstep = parameters.run.mode == "lockstep"
        self._simulated_time = Clock(self, self.run, parameters.plant.control_period if in_lockstep else 0.0)
        if parameters.run.clock_each_tick:
            self._link.asked = self._simulated_time.asked
        self._parameter_log = ParameterLog(self, declared, lambda: (self.run.run_id, self.run.stamp_ns))
        events = Events(self)
        self._faults = FaultServer(self, self.run, declared, events)
        self._control = Control(self, self.run)
        PreviewServer(self, parameters)
        self._standard = Standard(self, self.run, self._control) if INSTALLED else None
        if operate is not None:
            self._microscope = microscope_server.MicroscopeServer(self, self.run, declared, events)
        looks = [self.run.blocks.end_block, self.estimates.publish, self._look_for_peers, self._faults.look]
        if parameters.safety.unrecorded:
            looks.append(RecorderWatch(self, self.run, self._streams).look)
        reports = [self._reporter.compose_diagnostics, self._reporter.publish_diagnostics]
        if not inside:
            reports.insert(0, self._reporter.look_at_subscribers)
        self._tasks = PeriodicTasks(
            *(PeriodicTask(look, _STATUS_PERIOD) for look in [*looks, self._reporter.publish_status]),
            PeriodicTask(partial(self._look_for_peers, force=True), _DIAGNOSTICS_PERIOD),
            *(PeriodicTask(report, _DIAGNOSTICS_PERIOD) for report in reports),
            *(self._microscope.tasks if self._microscope is not None else ()),
        )
        self._reporter.log_state()
        log_timing(self.get_logger(), parameters)
        self._reporter.publish_status()
        slow = [name for name, there in self._link.fast_path.items() if not there]
        if slow:
            self.get_logger().warning(f"the control loop runs without {' and '.join(slow)}: it is slower")

    # What the run loop calls, beside `step` and `wait`.

    def serve_periodic(self) -> None:
        """Publish what is due: the clock, and one other thing at most, so that no tick waits for several."""
        now = time.monotonic()
        self._simulated_time.publish_at(now)
        # A few microseconds: it needs no turn of its own.
        if rate := self._declared.current.run.telemetry_rate:
            self._telemetry.publish_at(now, 1.0 / rate)
        self._parameter_log.look()
        self._tasks.run_next(now)
        if self._standard is not None:
            self._standard.look()

    def finish(self, spin_once: Callable[[float], None]) -> None:
        """Publish the last samples before the node ends, and answer the last goal."""
        self.run.flush()
        if self._microscope is not None:
            self._microscope.finish(spin_once)
        self._reporter.publish_status(over=True)
        self._streams.wait_for_delivery(_DELIVERY_TIMEOUT)
        self._reporter.wait_for_delivery(_DELIVERY_TIMEOUT)

    def destroy_node(self) -> None:
        """End the node."""
        self._link.close()
        self._telemetry.close()
        if self._standard is not None:
            self._standard.close()
        if self._microscope is not None:
            self._microscope.close()
        super().destroy_node()

    def _on_parameters(self, parameters: SimNodeParameters) -> None:
        self.run.adapt(parameters)
        log_timing(self.get_logger(), parameters)

    # What the run calls.

    def _on_state(self) -> None:
        self._reporter.state_changed()
        self._control.state_changed()
        state = self.run.state
        if state == RunState.WAITING:
            # After a reset, or with another instrument: nothing moves yet.
            give_back()
        if state == RunState.FINISHED:
            self._simulated_time.publish()
        if state in OVER and self._declared.current.run.exit_when_finished:
            self.exit_code = int(state == RunState.FAULT)
            signal.raise_signal(signal.SIGINT)  # the one way in which a node ends

    def _on_block(self, block: Block, round_trips: NDArray[np.float32]) -> None:
        self._streams.put(self.run.run_id, block, round_trips)
        if self.estimates.wanted:
            self.estimates.look(
                self.run.run_id, self.run.instrument.ticks - 1, self._declared.current.plant.control_period
            )
        # In lockstep no tick is late.
        if self.run.deadline is None:
            self._streams.publish_all()

    def _on_end(self) -> None:
        self.estimates.publish()
        self._streams.publish_all()
        self._peers.look(force=True)
        self._faults.look()
        self._reporter.publish_score()

    def _on_left(self) -> None:
        self._faults.look()
        self._parameter_log.look()
        self._streams.publish_all()
        self._reporter.publish_status(over=True)
        # The status of the next run takes its place, also where it has not come yet.
        self._reporter.wait_for_delivery(_LEFT_TIMEOUT)

    def _on_line(self, line: "Line") -> None:
        assert self._microscope is not None
        self._microscope.put_line(line)

    def _on_verb_over(self, outcome: "Outcome") -> None:
        assert self._microscope is not None
        self._microscope.verb_over(outcome)
        if self.run.deadline is None:
            # Goals and results refer to each other. By the clock the next tick would be late.
            gc.collect()

    # Now and then.

    def _look_for_peers(self, *, force: bool = False) -> None:
        self._peers.look(force=force)
        rivalry = self._peers.rivalry()
        if self.run.state == RunState.WAITING:
            self.run.tell_why_waiting(rivalry or self._peers.incompatible or self._peers.silent())
        if rivalry:
            self.run.fail(rivalry)


def main() -> int:
    """Entry point of `ros2 run afm_sim_node afm_sim_node`."""
    return runner.run(SimNode, SimNodeParameters)
