"""Send the data stream: signals again and again, to clients that are connected to a separate port."""

import socket
import struct
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress

IDLE, RUNNING = 1, 4
_PERIOD = 1e-3
"""Wall time from one sample to the next, without oversampling [s]."""
_SLOW = 1.0
"""Wall time after which a client that takes nothing is left alone [s]."""


class Stream:
    """Sends frames to whoever is connected.

    Parameters
    ----------
    values : callable
        Indices of signals -> their present values.
    """

    def __init__(self, values: Callable[[Iterable[int]], Sequence[float]]) -> None:
        self._values = values
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
            values = self._values(channels)
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
