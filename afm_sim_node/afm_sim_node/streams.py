"""Blocks of the instrument as Waveform and ControlTrace messages."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from afm_msgs.msg import ControlTrace, Waveform
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.node import Node

from afm_model import Block
from afm_model.parts import Channel
from afm_node_common import topics
from afm_node_common.cdr import BlockEncoder
from afm_node_common.process import SimNodeParameters

_BOOKKEEPING = ("verb_number", "verb_step", "verb_done")
"""Channels by which a verb finds its samples: no signals. Verbs are reported as events."""
_LONGEST_QUEUE = 500
"""Messages that wait to be published at most: some seconds of a run that leaves no time for them."""


class Streams:
    """Publishes every block of a run, so that recorders cost the control loop nothing per tick.

    A block is taken over by `put` and published message by message, by `publish_one`, in the time that a tick leaves.

    Parameters
    ----------
    node : Node
    parameters : SimNodeParameters
    channels : sequence of Channel
        Rows of a block's samples.
    """

    def __init__(self, node: Node, parameters: SimNodeParameters, channels: Sequence[Channel]) -> None:
        self._encode_waveform = BlockEncoder(Waveform).encode
        self._encode_trace = BlockEncoder(ControlTrace).encode
        detector = parameters.detector
        self._control_period = parameters.plant.control_period
        self._sample_period = detector.sample_period
        self._channels = [
            (number, self._publisher(node, channel.name), channel.scale(parameters), channel.unit)
            for number, channel in enumerate(channels)
            if channel.name not in _BOOKKEEPING
        ]
        self._trace = node.create_publisher(ControlTrace, topics.CONTROL_TRACE, topics.STREAM_QOS)
        self._queue: deque[Callable[[], None]] = deque()

    @staticmethod
    def _publisher(node: Node, topic: str) -> Any:
        return node.create_publisher(Waveform, topic, topics.STREAM_QOS)

    @property
    def subscribers(self) -> int:
        """Subscribers that receive every stream."""
        publishers = [self._trace, *(publisher for _, publisher, *_ in self._channels)]
        return min(int(publisher.get_subscription_count()) for publisher in publishers)

    def wait_for_delivery(self, timeout: float) -> None:
        """Wait until every recorder has received all blocks, at most `timeout` seconds of wall time.

        A packet that was lost is sent again only while its publisher lives.
        """
        self.publish_all()
        limit = time.monotonic() + timeout
        for publisher in (self._trace, *(publisher for _, publisher, *_ in self._channels)):
            publisher.wait_for_all_acked(Duration(seconds=max(limit - time.monotonic(), 0.0)))

    def put(self, run_id: int, block: Block, round_trip: NDArray[np.float32]) -> None:
        """Take over a block of a run and the round trips [s] of its ticks, (ticks,)."""
        for channel in self._channels:
            self._queue.append(partial(self._publish_samples, run_id, block, *channel))
        self._queue.append(partial(self._publish_trace, run_id, block, round_trip))
        while len(self._queue) > _LONGEST_QUEUE:
            self.publish_one()

    @property
    def waiting(self) -> int:
        """Messages that wait to be published."""
        return len(self._queue)

    def publish_one(self) -> None:
        """Publish the message that has waited longest."""
        self._queue.popleft()()

    def publish_all(self) -> None:
        """Publish all waiting blocks."""
        while self._queue:
            self.publish_one()

    def _publish_samples(self, run_id: int, block: Block, number: int, publisher: Any, scale: float, unit: str) -> None:
        if publisher.get_subscription_count():
            publisher.publish(
                self._encode_waveform(
                    round(block.first_sample * self._sample_period * 1e9),
                    run_id=run_id,
                    first_sample=block.first_sample,
                    sample_period=self._sample_period,
                    samples=block.samples[number],
                    scale=scale,
                    unit=unit,
                )
            )

    def _publish_trace(self, run_id: int, block: Block, round_trip: NDArray[np.float32]) -> None:
        if not self._trace.get_subscription_count():
            return
        rows = block.measurements
        self._trace.publish(
            self._encode_trace(
                round(block.first_tick * self._control_period * 1e9),
                run_id=run_id,
                first_sequence=block.first_tick,
                control_period=self._control_period,
                position=rows["position"],
                velocity=rows["velocity"],
                reference_position=rows["reference_position"],
                deflection=rows["deflection"],
                drive=block.drives,
                round_trip=round_trip,
            )
        )
