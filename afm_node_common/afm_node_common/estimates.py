"""What a law believes of the microscope, as Waveform messages: a recorder takes them as further channels."""

from collections.abc import Callable, Iterable

import numpy as np
from afm_msgs.msg import Waveform
from rclpy.node import Node

from afm_model.parts import LawEstimate

from . import topics
from .cdr import BlockEncoder
from .decoding import NANOSECONDS

_RASTER = 5e-3
"""Simulated time between two samples [s]."""
_LONGEST = 4096
"""Samples left out at most before the rest is a gap."""


class Estimates:
    """Publishes `Controller.estimates` on topics law/NAME while somebody listens.

    Parameters
    ----------
    node : Node
    believed : callable
        `estimates` of the controller at present; which there are is decided at construction.
    """

    def __init__(self, node: Node, believed: Callable[[], Iterable[LawEstimate]]) -> None:
        self._believed = believed
        self._encode = BlockEncoder(Waveform).encode
        self._publishers = {
            each.name: (node.create_publisher(Waveform, f"{topics.LAW}/{each.name}", topics.STREAM_QOS), each.unit)
            for each in believed()
        }
        self._samples: list[list[float]] = []  # that wait to be published
        self._first = 0  # number of the first of them
        self._run_id, self._tick, self._due, self._period = 0, 0, 0, 0.0
        self.wanted = False
        """Whether somebody listened when `publish` was called last."""

    def look(self, run_id: int, tick: int, control_period: float) -> None:
        """Sample what the law believes after its answer at this control tick of a run, if a sample is due."""
        if run_id == self._run_id and self._tick <= tick < self._due:
            return
        every = max(1, round(_RASTER / control_period))
        number = tick // every
        believed = [*self._believed()]
        if [each.name for each in believed] != [*self._publishers]:
            return
        left_out = number - self._first - len(self._samples)
        if run_id != self._run_id or tick < self._tick or not self._due or left_out > _LONGEST:
            # Another run, or nobody listened until now.
            self.publish()
            self._first, left_out = number, 0
        # Where no sample was taken the law is said to have believed what it does now.
        self._samples += [[each.value for each in believed]] * (left_out + 1)
        self._run_id, self._tick, self._due, self._period = run_id, tick, (number + 1) * every, every * control_period

    def publish(self) -> None:
        """Publish the samples that wait; to be called from time to time."""
        self.wanted = any(publisher.get_subscription_count() for publisher, _ in self._publishers.values())
        samples, self._samples = np.array(self._samples), []
        if not self.wanted:
            self._due = 0
        elif len(samples):
            stamp = round(self._first * self._period * NANOSECONDS)
            for (publisher, unit), values in zip(self._publishers.values(), samples.T, strict=True):
                publisher.publish(
                    self._encode(
                        stamp,
                        run_id=self._run_id,
                        first_sample=self._first,
                        sample_period=self._period,
                        samples=values,
                        scale=1.0,
                        unit=unit,
                    )
                )
            self._first += len(samples)
