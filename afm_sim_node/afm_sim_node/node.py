"""The simulator node: publishes measurements, takes drives, steps the instrument in lockstep or in real time."""

import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from afm_msgs.msg import InstrumentStatus, Measurement, PiezoDrive
from numpy.typing import NDArray
from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage
from std_srvs.srv import Trigger

from afm_model import DivergenceError, DriveError, Instrument
from afm_node_common import runner, topics
from afm_node_common.codec import drive_codec, measurement_codec
from afm_node_common.direct import Inbox, Outbox
from afm_node_common.parameters import declare
from afm_node_common.process import SimNodeParameters

from .pacing import Lockstep, Realtime
from .report import Reporter
from .streams import Streams, stamp
from .timing import Histogram, Stopwatch

TUNABLE = ("run.real_time_factor", "run.lockstep_timeout", "run.watchdog_timeout")
"""What may change while the instrument runs."""

_BLOCK_SAMPLES = 4000
_STATUS_PERIOD = 0.2
_DELIVERY_TIMEOUT = 5.0
_DIAGNOSTICS_PERIOD = 1.0
_CLOCK_PERIOD = 0.02  # a faster /clock costs every use_sim_time node a third of a core


@dataclass
class Chore:
    """Something to do again and again, every `period` of wall time [s]; next at `at`."""

    do: Callable[[], None]
    period: float
    at: float = 0.0


class SimNode(Node):
    """The virtual instrument on topics. `step` and `wait` are called by `afm_node_common.runner`."""

    def __init__(self) -> None:
        super().__init__("afm_sim_node", namespace=topics.NAMESPACE)
        self.parameters = declare(self, SimNodeParameters, tunable=TUNABLE, on_change=self._on_change)
        parameters = self.parameters
        self.process = parameters.process
        self.exit_code = 0
        samples_per_tick = round(parameters.plant.control_period / parameters.detector.sample_period)
        block_ticks = max(1, _BLOCK_SAMPLES // samples_per_tick)
        self.instrument = Instrument(parameters, block_ticks)
        self.warm_up()

        fast = parameters.process.fast_codec
        measurements, drives = measurement_codec(fast=fast), drive_codec(fast=fast)
        self._encode, self.decode = measurements.encode, drives.decode
        self.fast_path = {"direct takes": False, "fast codec": measurements.fast and drives.fast}
        self.inbox = Inbox(self, PiezoDrive, topics.PIEZO_DRIVE, topics.CONTROL_QOS)
        self._outbox = Outbox(self, Measurement, topics.MEASUREMENT, topics.CONTROL_QOS)
        self._clock_publisher = self.create_publisher(ClockMessage, topics.clock(self.get_namespace()), 1)
        self._publish = self._outbox.publish
        self.streams = Streams(self, parameters, self.instrument.channels)
        self.reporter = Reporter(self)
        self.step: Callable[[], bool] = self._rest
        """One look at the inbox or the clock; True if something was done."""
        self.pacing: Lockstep | Realtime = Lockstep(self) if parameters.run.mode == "lockstep" else Realtime(self)
        self._period_ns = parameters.plant.control_period * 1e9
        self._total_ticks = parameters.total_ticks  # 0: without end
        self.state = InstrumentStatus.WAITING
        self.detail = ""
        self._held = parameters.run.start_paused
        self._begin()

        for name, handler in ((topics.PLAY, self._play), (topics.PAUSE, self._pause), (topics.RESET, self._reset)):
            self.create_service(Trigger, name, handler)
        self._clock_at = 0.0
        self._chores = [
            Chore(self.flush, _STATUS_PERIOD),
            Chore(self.reporter.look_for_controller, _STATUS_PERIOD),
            Chore(self.reporter.publish_status, _STATUS_PERIOD),
            Chore(partial(self.reporter.look_for_controller, anew=True), _DIAGNOSTICS_PERIOD),
            Chore(self.reporter.compose_diagnostics, _DIAGNOSTICS_PERIOD),
            Chore(self.reporter.publish_diagnostics, _DIAGNOSTICS_PERIOD),
        ]
        self.set_state(InstrumentStatus.WAITING)
        self.reporter.log_state()
        self.fast_path["direct takes"] = self.inbox.direct and self._outbox.direct
        slow = [name for name, there in self.fast_path.items() if not there]
        if slow:
            self.get_logger().warning(f"the control loop runs without {' and '.join(slow)}: it is slower")

    # What the run loop calls.

    def _rest(self) -> bool:
        """Nothing to do."""
        return False

    def wait(self, timeout: float) -> None:
        """Sleep until a drive or a deadline, or for `timeout` seconds of wall time."""
        if self.state in (InstrumentStatus.RUNNING, InstrumentStatus.STALLED, InstrumentStatus.RETRACTED):
            self.pacing.wait(timeout)
        else:
            time.sleep(timeout)

    def look_after(self) -> None:
        """Publish what is due: the clock, and one other thing at most, so that no tick waits for several."""
        now = time.monotonic()
        if now >= self._clock_at:
            self._clock_at = now + _CLOCK_PERIOD
            self._publish_clock()
        chore = min(self._chores, key=lambda chore: chore.at)
        if now >= chore.at:
            chore.at = now + chore.period
            chore.do()

    # What the pacing calls.

    @property
    def stamp_ns(self) -> int:
        """Simulated time of the next control tick [ns]."""
        return round(self.instrument.ticks * self._period_ns)

    def publish_measurement(self) -> None:
        """Publish the measurement of the next control tick."""
        instrument = self.instrument
        ticks = instrument.ticks
        self._publish(self._encode(ticks, round(ticks * self._period_ns), instrument.measurement))

    def tick(self, drive: NDArray[np.float64], round_trip: float) -> bool:
        """Apply a drive [V] for one tick; False if the run ended with it."""
        instrument = self.instrument
        self._round_trip.append(round_trip)
        try:
            instrument.tick(drive)
        except DriveError:
            self._round_trip.pop()
            raise
        except DivergenceError as error:
            self.flush()
            self.set_state(InstrumentStatus.FAULT, self.pacing.explain(str(error)))
            return False
        if instrument.block_full:
            self.flush()
        if instrument.ticks == self._total_ticks:
            self._finish()
            return False
        return True

    def note_delay(self, lateness: float, command_age: float) -> None:
        """Count how late a tick was, and how old the measurement behind the drive in force [s]."""
        self._late.append(lateness)
        self._ages.append(command_age)

    def refuse(self, error: DriveError, sequence: int) -> str:
        """Count a drive that was refused; the sentence that tells it."""
        self.drives_refused += 1
        return f"{error} (answer to measurement {sequence} from {self.reporter.controller or 'an unknown node'})"

    def set_state(self, state: int, detail: str = "") -> None:
        """Change the state, log and publish it."""
        changed = (state, detail) != (self.state, self.detail)
        self.state, self.detail = state, detail
        # What the run loop calls from now on; at this rate a call more would be felt.
        self.step = {
            InstrumentStatus.WAITING: self._start_when_ready,
            InstrumentStatus.RUNNING: self.pacing.step,
            InstrumentStatus.STALLED: self.pacing.step,
            InstrumentStatus.RETRACTED: self.pacing.step,
        }.get(state, self._rest)
        if state == InstrumentStatus.RUNNING:
            self.watch.start()
        elif state not in (InstrumentStatus.STALLED, InstrumentStatus.RETRACTED):
            self.watch.stop()
        if changed:
            self.reporter.log_state()
        self.reporter.publish_status()
        if state in (InstrumentStatus.FINISHED, InstrumentStatus.FAULT) and self.parameters.run.exit_when_finished:
            self.exit_code = int(state == InstrumentStatus.FAULT)
            signal.raise_signal(signal.SIGINT)  # the one way in which a node ends

    def flush(self) -> None:
        """Publish what was recorded since the last block."""
        if self._round_trip:
            round_trip = np.array(self._round_trip, np.float32)
            self._round_trip.clear()
            self.round_trips.add(round_trip)
            for histogram, times in ((self.lateness, self._late), (self.command_ages, self._ages)):
                histogram.add(np.array(times))
                times.clear()
            self.streams.publish(self.instrument.take_block(), round_trip)

    def warm_up(self) -> None:
        """Compile or load the kernels by one tick, then start afresh."""
        self.instrument.tick(self.instrument.drive)
        self.instrument.reset()

    # Life of a run.

    def _begin(self) -> None:
        """Counters of a run that has not started."""
        self._round_trip: list[float] = []
        self.watch = Stopwatch()
        self.round_trips = Histogram()
        self.lateness = Histogram()
        self.command_ages = Histogram()
        self._late: list[float] = []
        self._ages: list[float] = []
        self.drives_lost = self.drives_refused = 0
        self.late_ticks = self.periods_missed = self.ticks_retracted = 0

    def _start_when_ready(self) -> bool:
        if self._held or not self.inbox.publishers or not self._outbox.subscribers:
            return False
        if self.parameters.run.wait_for_recorder and not self.streams.subscribers:
            return False
        self.reporter.look_for_controller(anew=True)
        self.set_state(InstrumentStatus.RUNNING)
        self.pacing.start()
        return True

    def _finish(self) -> None:
        self.watch.stop()
        self.flush()
        self.reporter.look_for_controller(anew=True)
        self.reporter.publish_score()
        self.set_state(InstrumentStatus.FINISHED)
        self._publish_clock()

    def finish(self, spin_once: object) -> None:
        """Publish the last samples before the node ends."""
        self.flush()
        self.reporter.publish_status()
        self.streams.wait_for_delivery(_DELIVERY_TIMEOUT)

    def destroy_node(self) -> None:
        """End the node."""
        self.inbox.close()
        self._outbox.close()
        super().destroy_node()

    # Services and timers.

    def _play(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._held = False
        if self.state == InstrumentStatus.PAUSED:
            self.set_state(InstrumentStatus.RUNNING)
            self.pacing.resume()
        response.success = self.state not in (InstrumentStatus.FINISHED, InstrumentStatus.FAULT)
        response.message = "" if response.success else "the run is over: call reset first"
        return response

    def _pause(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.state == InstrumentStatus.WAITING:
            self._held = True
        elif self.state not in (InstrumentStatus.FINISHED, InstrumentStatus.FAULT):
            self.set_state(InstrumentStatus.PAUSED)
        response.success = self.state in (InstrumentStatus.WAITING, InstrumentStatus.PAUSED)
        response.message = "" if response.success else "the run is over: there is nothing to pause"
        return response

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.flush()
        self.instrument.reset()
        self._held = self.parameters.run.start_paused
        self._begin()
        self.set_state(InstrumentStatus.WAITING)
        response.success = True
        return response

    def _publish_clock(self) -> None:
        self._clock_publisher.publish(ClockMessage(clock=stamp(self.stamp_ns)))

    def _on_change(self, parameters: SimNodeParameters) -> None:
        self.parameters = parameters
        self.pacing.adapt()


def main() -> int:
    """Entry point of `ros2 run afm_sim_node afm_sim_node`."""
    return runner.run(SimNode, SimNodeParameters)
