"""The two ways in which simulated time goes on: with each answer (lockstep), or with the steady clock (realtime)."""

import math
import time
from time import monotonic
from typing import TYPE_CHECKING

import numpy as np
from afm_msgs.msg import InstrumentStatus

from afm_model import DriveError

if TYPE_CHECKING:
    from .node import SimNode

_RESEND_PERIOD = 1.0
"""Wall time after which an unanswered measurement is sent again [s]: a restarted controller has not seen it."""
_RING = 4096
_STALLED = InstrumentStatus.STALLED  # there a property, looked up by a call


class Lockstep:
    """Publish measurement k, wait for the drive that answers k, tick. No delay in simulated time, at any speed."""

    def __init__(self, node: "SimNode") -> None:
        self._node = node
        self._take, self._decode, self._instrument = node.inbox.take, node.decode, node.instrument
        self._sent_at = self._asked_at = 0.0

    def start(self) -> None:
        """Ask for the first drive."""
        self.resume()
        self._node.publish_measurement()

    def resume(self) -> None:
        """Go on after a pause; an answer that came meanwhile is still in the inbox."""
        self._sent_at = self._asked_at = monotonic()

    def adapt(self) -> None:
        """Nothing depends on what may change while running."""

    def explain(self, divergence: str) -> str:
        """Nothing to add: the drive that was applied had seen the last measurement."""
        return divergence

    def step(self) -> bool:
        """Take one answer if there is one."""
        taken = self._take()
        if taken is None:
            self._look_at_the_clock()
            return False
        sequence, _, drive = self._decode(taken[0])
        if sequence != self._instrument.ticks:
            # The second answer to a measurement that was sent twice, or of a controller that guesses.
            return True
        node = self._node
        if node.state == _STALLED:
            node.set_state(InstrumentStatus.RUNNING)
        try:
            going_on = node.tick(drive, monotonic() - self._sent_at)
        except DriveError as error:
            node.flush()
            node.set_state(InstrumentStatus.FAULT, node.refuse(error, sequence))
            return True
        if going_on:
            self._sent_at = self._asked_at = monotonic()
            node.publish_measurement()
        return True

    def _look_at_the_clock(self) -> None:
        node = self._node
        now = monotonic()
        if now - self._asked_at > _RESEND_PERIOD:
            # The very first one may have gone out before the controller's side had matched: nothing is lost then.
            if node.instrument.ticks > 0 and self._asked_at == self._sent_at:
                node.drives_lost += 1
            self._asked_at = now
            node.publish_measurement()
        timeout = node.parameters.run.lockstep_timeout
        if now - self._sent_at > timeout and node.state == InstrumentStatus.RUNNING:
            name = node.reporter.controller or "the controller"
            node.set_state(
                InstrumentStatus.STALLED,
                f"{name} has not answered measurement {node.instrument.ticks} within {timeout:g} s "
                f"(run.lockstep_timeout); still waiting",
            )

    def wait(self, timeout: float) -> None:
        """Sleep until an answer may be there."""
        self._node.inbox.wait(timeout)


class Realtime:
    """Tick at absolute deadlines of the steady clock, with the newest drive or the last one held."""

    def __init__(self, node: "SimNode") -> None:
        self._node = node
        self._drive = np.zeros(3)
        self._published_at = np.zeros(_RING)
        self._retract_from = 0.0
        self._asked_at = math.nan  # when the measurement was published that the drive in force answers

    def start(self) -> None:
        """Hold the drive of the start; the first deadline is one period from now."""
        self._drive[:] = self._node.instrument.drive
        self._asked_at = math.nan
        self.resume()
        self._publish()

    def resume(self) -> None:
        """Begin a new series of deadlines; a controller has its time again."""
        self._period = 0.0
        self.adapt()
        self._last_drive_at = monotonic()

    def adapt(self) -> None:
        """Follow a change of the parameters: another period is a new series of deadlines."""
        parameters = self._node.parameters
        period = parameters.plant.control_period / parameters.run.real_time_factor
        if period != self._period:
            self._period = period
            self._deadline = monotonic() + period

    def explain(self, divergence: str) -> str:
        """Add how old the drives were, which makes a loop unstable that is not in lockstep."""
        oldest = self._node.command_ages.largest / self._period
        return (
            f"{divergence}, or the drives are too late: they were up to {oldest:.3g} control periods old (lower "
            f"run.real_time_factor = {self._node.parameters.run.real_time_factor:g} to give the controller time)"
        )

    def _publish(self) -> None:
        self._published_at[self._node.instrument.ticks % _RING] = monotonic()
        self._node.publish_measurement()

    def step(self) -> bool:
        """Tick if the deadline has come."""
        now = monotonic()
        if now < self._deadline:
            return False
        late = now - self._deadline
        missed = int(late / self._period)
        node = self._node
        if missed:
            # Periods left out stay left out: a burst of ticks would show the controller a time that never was.
            node.late_ticks += 1
            node.periods_missed += missed
        self._deadline += (missed + 1) * self._period
        round_trip = self._take_newest(now)
        node.note_delay(late, now - self._asked_at)
        if np.isnan(round_trip):
            node.drives_lost += 1
        self._watch_over(now)
        if node.tick(self._drive, round_trip):
            self._publish()
        return True

    def _take_newest(self, now: float) -> float:
        """Put the newest valid drive in force; its round trip [s], NaN if none came since the last tick."""
        node = self._node
        round_trip = float("nan")
        while (taken := node.inbox.take()) is not None:
            sequence, _, drive = node.decode(taken[0])
            age = node.instrument.ticks - sequence
            if not 0 <= age < _RING:
                continue
            if not np.isfinite(drive).all():
                node.get_logger().error(
                    node.refuse(DriveError(f"drive {drive.tolist()} V is not allowed: it must be finite"), sequence)
                    + "; it is not applied",
                    throttle_duration_sec=1.0,
                )
                continue
            self._drive[:] = drive
            self._last_drive_at = now
            self._asked_at = self._published_at[sequence % _RING]
            round_trip = now - self._asked_at
        return round_trip

    def _watch_over(self, now: float) -> None:
        """Retract the sample when the controller has been silent for too long; come back with its next drive."""
        node = self._node
        run = node.parameters.run
        silent = now - self._last_drive_at > run.watchdog_timeout
        if silent and node.state == InstrumentStatus.RUNNING:
            self._retract_from = self._drive[2]
            name = node.reporter.controller or "the controller"
            node.set_state(
                InstrumentStatus.RETRACTED,
                f"no valid drive from {name} for {run.watchdog_timeout:g} s (run.watchdog_timeout; "
                f"{node.drives_refused} refused as NaN or infinite): the sample is retracted",
            )
        elif not silent and node.state == InstrumentStatus.RETRACTED:
            node.set_state(InstrumentStatus.RUNNING)
        if node.state == InstrumentStatus.RETRACTED:
            node.ticks_retracted += 1
            down = -run.retract_distance / node.parameters.piezo.sensitivity_z
            rate = (down - self._retract_from) / run.retract_time
            moved = self._drive[2] + rate * node.parameters.plant.control_period
            self._drive[2] = max(moved, down) if rate < 0.0 else min(moved, down)

    def wait(self, timeout: float) -> None:
        """Sleep until the deadline."""
        left = self._deadline - monotonic() - self._node.parameters.run.spin_time
        if left > 0.0:
            time.sleep(min(left, timeout))
