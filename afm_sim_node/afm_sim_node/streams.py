"""Blocks of the instrument as Waveform and ControlTrace messages."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from afm_msgs.msg import ControlTrace, Waveform
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.node import Node

from afm_model import Block
from afm_model.parts import Channel
from afm_node_common import topics
from afm_node_common.codec import BlockEncoder
from afm_node_common.process import SimNodeParameters


def stamp(nanoseconds: int) -> Time:
    """Simulated time as a message."""
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return Time(sec=seconds, nanosec=rest)


class Streams:
    """Publishes every block of a run, so that recorders cost the control loop nothing per tick.

    Parameters
    ----------
    node : Node
    parameters : SimNodeParameters
    channels : sequence of Channel
        Rows of a block's samples.
    """

    def __init__(self, node: Node, parameters: SimNodeParameters, channels: Sequence[Channel]) -> None:
        fast = parameters.process.fast_codec
        self._encode_waveform = BlockEncoder(Waveform, fast=fast).encode
        self._encode_trace = BlockEncoder(ControlTrace, fast=fast).encode
        detector = parameters.detector
        self._control_period = parameters.plant.control_period
        self._sample_period = detector.sample_period
        self._channels = [
            (self._publisher(node, channel.name), channel.scale(parameters), channel.unit) for channel in channels
        ]
        self._trace = node.create_publisher(ControlTrace, topics.CONTROL_TRACE, topics.STREAM_QOS)

    @staticmethod
    def _publisher(node: Node, topic: str) -> Any:
        return node.create_publisher(Waveform, topic, topics.STREAM_QOS)

    @property
    def subscribers(self) -> int:
        """Subscribers that receive every stream."""
        publishers = [self._trace, *(publisher for publisher, *_ in self._channels)]
        return min(int(publisher.get_subscription_count()) for publisher in publishers)

    def wait_for_delivery(self, timeout: float) -> None:
        """Wait until every recorder has what was published, at most `timeout` seconds of wall time.

        A packet that was lost is sent again only while its publisher lives.
        """
        limit = time.monotonic() + timeout
        for publisher in (self._trace, *(publisher for publisher, *_ in self._channels)):
            publisher.wait_for_all_acked(Duration(seconds=max(limit - time.monotonic(), 0.0)))

    def publish(self, block: Block, round_trip: NDArray[np.float32]) -> None:
        """Publish a block and the round trips [s] of its ticks, (ticks,)."""
        first = round(block.first_sample * self._sample_period * 1e9)
        for samples, (publisher, scale, unit) in zip(block.samples, self._channels, strict=True):
            if publisher.get_subscription_count():
                publisher.publish(
                    self._encode_waveform(
                        first,
                        first_sample=block.first_sample,
                        sample_period=self._sample_period,
                        samples=samples,
                        scale=scale,
                        unit=unit,
                    )
                )
        if not self._trace.get_subscription_count():
            return
        rows = block.measurements
        self._trace.publish(
            self._encode_trace(
                round(block.first_tick * self._control_period * 1e9),
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
