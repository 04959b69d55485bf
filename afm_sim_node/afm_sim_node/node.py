"""The simulator node: a run of the instrument on topics, with services, streams and reports."""

import signal
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from afm_msgs.msg import RecorderStatus
from numpy.typing import NDArray
from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage

from afm_model import Block, Controller, Instrument
from afm_model.parameters.simulator_parameters import is_inside
from afm_model.run import OVER, Listeners, Run, State
from afm_node_common import runner, topics
from afm_node_common.parameters import Declared
from afm_node_common.periodic import PeriodicTask, PeriodicTasks
from afm_node_common.process import SimNodeParameters
from afm_node_common.subscriptions import Subscriptions

from .control import Control
from .faults import Faults
from .inside_link import InsideLink
from .link import TopicLink
from .peers import Peers
from .reporter import Reporter
from .standard import INSTALLED, Standard
from .streams import Streams, clock_bytes
from .telemetry import Telemetry

if TYPE_CHECKING:
    from afm_model.microscope.image import Line
    from afm_model.microscope.operator import Operator
    from afm_model.microscope.results import Outcome

    from .microscope_server import MicroscopeServer

TUNABLE = ("run.real_time_factor", "run.lockstep_timeout", "run.watchdog_timeout", "run.telemetry_rate", "law.")
"""What may change while the instrument runs; of the law one that is inside."""

_BLOCK_SAMPLES = 4000
"""Samples of a channel in a block at most."""
_BLOCK_COST = 2.5e-7
"""Wall time for each tick of a block to copy and hash it, and about as much again to write its trace [s]."""
_SMALLEST_BLOCK = 64
"""Control ticks; smaller ones cost the recorder more than they spare the loop."""
_STATUS_PERIOD = 0.2
_DELIVERY_TIMEOUT = 5.0
_DIAGNOSTICS_PERIOD = 1.0
_ROOM = 0.1
"""Part of a period that must be left before a deadline for a message of the streams to be published.

One may take longer than what is left: the next tick is then late, and the ones behind it make up for it before another
message goes out.
"""
_CLOCK_PERIOD = 0.02  # a faster /clock costs every use_sim_time node a third of a core


class SimNode(Node):
    """The virtual instrument on topics. `step` and `wait` are called by `afm_node_common.runner`."""

    def __init__(self) -> None:
        super().__init__("afm_sim_node", namespace=topics.NAMESPACE)
        declared = Declared(
            self,
            SimNodeParameters,
            tunable=TUNABLE,
            complete=_with_verbs,
            accepts=_check_law_inside,
            on_change=self._on_change,
            exchanged=_exchanged,
        )
        self._declared = declared
        self.parameters = parameters = declared.current
        self.process = parameters.process
        self.exit_code = 0
        self._period = _wall_period(parameters)
        inside = is_inside(parameters.law)
        self._peers = Peers(self, law_inside=inside)
        make_link = InsideLink if inside else TopicLink
        self._link = make_link(self, parameters, self._peers, recorders=lambda: self._streams.subscribers)
        self._microscope: MicroscopeServer | None = None
        self.run = Run(
            parameters,
            self._link,
            time.monotonic,
            Listeners(changed=self._on_state, block=self._on_block, ended=self._on_end, verb_over=self._on_verb_over),
            block_ticks=_block_ticks(parameters),
            operate=self._operate() if parameters.reference.kind == "verbs" else None,
            in_pieces=parameters.run.mode == "realtime",
        )
        """The life of the instrument."""
        self.step = self.run.step
        self._streams = Streams(self, parameters, self.run.instrument.channels)
        self.run.warm_up()
        self._telemetry = Telemetry(self, self.run)
        self._reporter = Reporter(self, self.run, self._link, self._peers, self._streams, parameters)
        self._clock_publisher = self.create_publisher(ClockMessage, topics.clock(self.get_namespace()), 1)
        self._faults = Faults(self, self.run, declared)
        self._control = Control(self, self.run, before_reset=self._faults.look)
        self._standard = Standard(self, self.run, self._control) if INSTALLED else None
        if self.run.operator is not None:
            from . import microscope_server

            self._microscope = microscope_server.MicroscopeServer(self, self.run, self._exchange, self._on_setting)
        self._recorder_problem = ""
        if parameters.safety.unrecorded:
            Subscriptions(self).subscribe(RecorderStatus, topics.RECORDER_STATUS, self._on_recorder, topics.LATCHED_QOS)
        self._clock_at = 0.0
        self._tasks = PeriodicTasks(
            PeriodicTask(self.run.blocks.end_block, _STATUS_PERIOD),
            PeriodicTask(self._look_for_peers, _STATUS_PERIOD),
            PeriodicTask(self._faults.look, _STATUS_PERIOD),
            PeriodicTask(self._look_at_the_recorder, _STATUS_PERIOD),
            PeriodicTask(self._reporter.publish_status, _STATUS_PERIOD),
            PeriodicTask(partial(self._look_for_peers, force=True), _DIAGNOSTICS_PERIOD),
            PeriodicTask(self._reporter.compose_diagnostics, _DIAGNOSTICS_PERIOD),
            PeriodicTask(self._reporter.publish_diagnostics, _DIAGNOSTICS_PERIOD),
            *(self._microscope.tasks if self._microscope is not None else ()),
        )
        self._reporter.log_state()
        self._reporter.publish_status()
        slow = [name for name, there in self._link.fast_path.items() if not there]
        if slow:
            self.get_logger().warning(f"the control loop runs without {' and '.join(slow)}: it is slower")

    # What the run loop calls.

    def wait(self, timeout: float) -> None:
        """Sleep until a drive or a deadline, or for `timeout` seconds of wall time."""
        if not self.run.ticking:
            while self.run.blocks.do_one():
                pass
            self._streams.publish_all()
            time.sleep(timeout)
        elif (deadline := self.run.deadline) is None:
            self._link.wait(timeout)
        else:
            left = deadline - time.monotonic()
            if left > _ROOM * self._period:
                if self.run.blocks.do_one():
                    return
                if self._streams.waiting:
                    self._streams.publish_one()
                    return
            left -= self.parameters.run.spin_time
            if left > 0.0:
                time.sleep(min(left, timeout))

    def serve_periodic(self) -> None:
        """Publish what is due: the clock, and one other thing at most, so that no tick waits for several."""
        now = time.monotonic()
        if now >= self._clock_at:
            self._clock_at = now + _CLOCK_PERIOD
            self._publish_clock()
        # A few microseconds: it needs no turn of its own.
        if rate := self.parameters.run.telemetry_rate:
            self._telemetry.publish_at(now, 1.0 / rate)
        self._tasks.run_next(now)
        if self._standard is not None:
            self._standard.look()

    def finish(self, spin_once: Callable[[float], None]) -> None:
        """Publish the last samples before the node ends, and answer the last goal."""
        self.run.flush()
        if self._microscope is not None:
            self._microscope.finish(spin_once)
        self._reporter.publish_status()
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

    # What the run calls.

    def _on_state(self) -> None:
        self._reporter.state_changed()
        self._control.state_changed()
        state = self.run.state
        if state == State.FINISHED:
            self._publish_clock()
        if state in OVER and self.parameters.run.exit_when_finished:
            self.exit_code = int(state == State.FAULT)
            signal.raise_signal(signal.SIGINT)  # the one way in which a node ends

    def _on_block(self, block: Block, round_trips: NDArray[np.float32]) -> None:
        self._streams.put(block, round_trips)
        # In lockstep no tick is late.
        if self.run.deadline is None:
            self._streams.publish_all()

    def _on_end(self) -> None:
        self._streams.publish_all()
        self._peers.look(force=True)
        self._faults.look()
        self._reporter.publish_score()

    def _operate(self) -> "Callable[[Instrument], Operator]":
        # Here: whoever orders no verbs need not wait for them to be imported.
        from .microscope_server import operator_of

        return partial(operator_of, self._on_line)

    def _exchange(self, group: str, changes: dict[str, Any]) -> None:
        """Put in another sample or probe; raises ParameterError or VerbError."""
        from afm_model.microscope.local import exchanged

        made = exchanged(self._declared.current, self.run.operator.state, group, changes)
        self._faults.look()
        self.run.exchange(made)
        self._declared.exchange(made)
        self.parameters = made

    def _on_setting(self) -> None:
        """The loop inside was set by a service: so it stands in the parameters, and is recorded."""
        onboard = self.run.instrument.parameters.onboard
        self._declared.exchange(self._declared.current.model_copy(update={"onboard": onboard}))
        self.parameters = self._declared.current

    def _on_line(self, line: "Line") -> None:
        if self._microscope is not None:
            self._microscope.put_line(line)

    def _on_verb_over(self, outcome: "Outcome") -> None:
        if self._microscope is not None:
            self._microscope.verb_over(outcome)

    # Now and then.

    def _look_for_peers(self, *, force: bool = False) -> None:
        self._peers.look(force=force)
        rivalry = self._peers.rivalry()
        self.run.tell_why_waiting(rivalry or self._peers.incompatible)
        if rivalry:
            self.run.fail(rivalry)

    def _on_recorder(self, status: RecorderStatus) -> None:
        self._recorder_problem = "" if status.writing else status.detail or "the recorder cannot write"

    def _look_at_the_recorder(self) -> None:
        if self.parameters.safety.unrecorded:
            nobody = "" if self._streams.subscribers else "no recorder receives every stream"
            self.run.tell_recorder(self._recorder_problem or nobody)

    def _publish_clock(self) -> None:
        # As bytes: rclpy's conversion of a message takes longer than a tick may.
        self._clock_publisher.publish(clock_bytes(self.run.stamp_ns))

    # Parameters.

    def _on_change(self, parameters: SimNodeParameters) -> None:
        self.parameters = parameters
        self._period = _wall_period(parameters)
        self.run.adapt(parameters)


def _with_verbs(parameters: SimNodeParameters) -> SimNodeParameters:
    """With what verbs need, if they are to be ordered."""
    if parameters.reference.kind != "verbs":
        return parameters
    from afm_model.microscope.prepare import with_verbs

    return with_verbs(parameters)


def _exchanged(parameters: SimNodeParameters) -> dict[str, str]:
    """What services change, where verbs are ordered."""
    if parameters.reference.kind != "verbs":
        return {}
    setting = f"{topics.SET_SETPOINT}, {topics.SET_GAINS} or {topics.SET_FEEDBACK}"
    return {"sample.": topics.SET_SAMPLE, "plant.": topics.SET_PROBE, "onboard.": setting}


def _check_law_inside(parameters: SimNodeParameters) -> None:
    """Raise ParameterError if the law inside cannot be computed with these parameters."""
    if (inside := parameters.controller_inside) is not None:
        Controller(inside)


def _wall_period(parameters: SimNodeParameters) -> float:
    """Wall time between two ticks in real time [s]."""
    return parameters.plant.control_period / parameters.run.real_time_factor


def _block_ticks(parameters: SimNodeParameters) -> int:
    """Control ticks in a block. In realtime it is handed on between two ticks, and has to fit there."""
    samples_per_tick = round(parameters.plant.control_period / parameters.detector.sample_period)
    most = max(1, _BLOCK_SAMPLES // samples_per_tick)
    if parameters.run.mode == "lockstep":
        return most
    return min(most, max(_SMALLEST_BLOCK, round(0.5 * _wall_period(parameters) / _BLOCK_COST)))


def main() -> int:
    """Entry point of `ros2 run afm_sim_node afm_sim_node`."""
    return runner.run(SimNode, SimNodeParameters)
