"""Commands of the data stream."""

from typing import Any

from .codec import ProtocolError
from .front import Front
from .handlers import handles
from .signal_index import COUNT
from .stream import IDLE, RUNNING


@handles("TCPLog.ChsSet")
def _channels(front: Front, channels: list[int]) -> list[Any]:
    if not channels or any(not 0 <= index < COUNT for index in channels):
        raise ProtocolError(f"signals {channels} are not allowed: each must be 0 to {COUNT - 1}")
    front.stream.channels = channels[:COUNT]
    return []


@handles("TCPLog.OversamplSet")
def _oversampling(front: Front, count: int) -> list[Any]:
    if not 0 <= count <= 1000:
        raise ProtocolError(f"oversampling {count} is not allowed: it must be 0 to 1000")
    front.stream.oversampling = count
    return []


@handles("TCPLog.Start")
def _start(front: Front) -> list[Any]:
    front.stream.start()
    return []


@handles("TCPLog.Stop")
def _stop(front: Front) -> list[Any]:
    front.stream.stop()
    return []


@handles("TCPLog.StatusGet")
def _status(front: Front) -> list[Any]:
    return [RUNNING if front.stream.running else IDLE]
