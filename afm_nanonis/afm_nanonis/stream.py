"""The data stream: signals again and again, to clients that are connected to a port of its own."""

import socket
import struct
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from .codec import ProtocolError
from .handlers import handles
from .signals import COUNT

if TYPE_CHECKING:
    from .front import Front

IDLE, RUNNING = 1, 4
_PERIOD = 1e-3
"""Wall time from one sample to the next, without oversampling [s]."""
_SLOW = 1.0
"""Wall time after which a client that takes nothing is left alone [s]."""


class Stream:
    """Sends frames to whoever is connected.

    Parameters
    ----------
    front : Front
    """

    def __init__(self, front: "Front") -> None:
        self._front = front
        self.channels: list[int] = [14]
        self.oversampling = 10
        self.running = False
        self._clients: list[socket.socket] = []
        self._lock = threading.Lock()
        self._stop = threading.Event()

    def accept(self, client: socket.socket) -> None:
        """Send frames to this one, too."""
        client.settimeout(_SLOW)
        with self._lock:
            self._clients.append(client)

    def start(self) -> None:
        """Begin to send."""
        if not self.running:
            self.running = True
            self._stop.clear()
            threading.Thread(target=self._run, name="afm_nanonis_stream", daemon=True).start()

    def stop(self) -> None:
        """Send no more."""
        self.running = False
        self._stop.set()

    def close(self) -> None:
        """Leave all clients."""
        self.stop()
        with self._lock:
            for client in self._clients:
                client.close()
            self._clients.clear()

    def _run(self) -> None:
        counter = 0
        while self.running:
            channels, many = list(self.channels), max(self.oversampling, 1)
            values = self._front.signals.values(channels)
            frame = struct.pack(">IfQH", len(channels), float(self.oversampling), counter, RUNNING)
            self._send(frame + struct.pack(f">{len(values)}f", *values))
            counter += 1
            self._stop.wait(_PERIOD * many)

    def _send(self, frame: bytes) -> None:
        with self._lock:
            for client in list(self._clients):
                try:
                    client.sendall(frame)
                except OSError:
                    self._clients.remove(client)
                    with suppress(OSError):
                        client.close()


@handles("TCPLog.ChsSet")
def _channels(front: "Front", channels: list[int]) -> list[Any]:
    if not channels or any(not 0 <= index < COUNT for index in channels):
        raise ProtocolError(f"signals {channels} are not allowed: each must be 0 to {COUNT - 1}")
    front.stream.channels = channels[:COUNT]
    return []


@handles("TCPLog.OversamplSet")
def _oversampling(front: "Front", count: int) -> list[Any]:
    if not 0 <= count <= 1000:
        raise ProtocolError(f"oversampling {count} is not allowed: it must be 0 to 1000")
    front.stream.oversampling = count
    return []


@handles("TCPLog.Start")
def _start(front: "Front") -> list[Any]:
    front.stream.start()
    return []


@handles("TCPLog.Stop")
def _stop(front: "Front") -> list[Any]:
    front.stream.stop()
    return []


@handles("TCPLog.StatusGet")
def _status(front: "Front") -> list[Any]:
    return [RUNNING if front.stream.running else IDLE]
