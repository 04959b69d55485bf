"""Serve the ports: several connections at a time, the commands of each one after the other."""

import socket
import threading
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from . import bias, motion, others, scanning, signal_commands, spectra, stream_commands  # noqa: F401  # their handlers
from .codec import HEADER, ProtocolError, arguments, failure, head, success
from .front import Front
from .table import COMMANDS

PORTS = (6501, 6502, 6503, 6504)
STREAM_PORT = 6590
ADDRESS = "127.0.0.1"
_MOST = 64
"""Connections at one time; further ones are closed at once."""
_WAITING = 128
"""Connections that may wait to be accepted."""


def _received(client: socket.socket, count: int) -> bytes | None:
    """So many bytes; None if the connection has ended before."""
    content = bytearray()
    while len(content) < count:
        more = client.recv(min(count - len(content), 1 << 16))
        if not more:
            return None
        content += more
    return bytes(content)


class Server:
    """Listens on the ports, and answers.

    Parameters
    ----------
    front : Front
    ports : sequence of int
        Of commands; 0: any free one.
    stream_port : int
        Of the data stream.
    address : str
        On which it listens: the default is for clients on this machine alone.
    real_errors : bool
        Errors as real controllers send them, see `codec.failure`.

    Raises
    ------
    OSError
        If a port cannot be had.
    """

    def __init__(
        self,
        front: Front,
        ports: Sequence[int] = PORTS,
        stream_port: int = STREAM_PORT,
        address: str = ADDRESS,
        *,
        real_errors: bool = False,
    ) -> None:
        self._front, self._real_errors = front, real_errors
        self._clients: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._listening: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        try:
            for port in (*ports, stream_port):
                self._listening.append(socket.create_server((address, port), backlog=_WAITING))
        except BaseException:
            self.close()
            raise
        *commands, stream = self._listening
        self.ports = [listening.getsockname()[1] for listening in commands]
        self.stream_port = int(stream.getsockname()[1])
        for listening, take in (*((each, self._begin) for each in commands), (stream, front.stream.accept)):
            self._thread(self._accept, listening, take)

    def _thread(self, target: Any, *given: Any) -> None:
        threading.Thread(target=target, args=given, name="afm_nanonis", daemon=True).start()

    def _accept(self, listening: socket.socket, take: Any) -> None:
        while True:
            try:
                client, _ = listening.accept()
            except OSError:
                if listening.fileno() < 0:
                    return
                continue
            take(client)

    def _begin(self, client: socket.socket) -> None:
        with self._lock:
            if len(self._clients) >= _MOST:
                client.close()
                return
            self._clients.add(client)
        self._thread(self._serve, client)

    def _serve(self, client: socket.socket) -> None:
        try:
            with client, suppress(OSError):
                # Small answers are not to wait for more.
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                while (asked := _received(client, HEADER)) is not None:
                    if not self._answer(client, asked):
                        return
        finally:
            with self._lock:
                self._clients.discard(client)

    def _answer(self, client: socket.socket, asked: bytes) -> bool:
        """Answer one request; False if the connection is to be closed."""
        try:
            name, field, length, answered = head(asked)
        except ProtocolError as error:
            # Where the next request begins is not known.
            client.sendall(failure(None, asked[:32], str(error), self._real_errors))
            return False
        body = _received(client, length)
        if body is None:
            return False
        command = COMMANDS.get(name)
        try:
            if command is None:
                raise ProtocolError("Module not available: this command does not exist here")
            answer = success(command, field, self._front.serve(command, arguments(command, body)))
        except ProtocolError as error:
            answer = failure(command, field, str(error), self._real_errors)
        except Exception as error:
            # Whatever a request leads to, its client is answered.
            answer = failure(command, field, f"{type(error).__name__}: {error}", self._real_errors)
        if answered:
            client.sendall(answer)
        return True

    def close(self) -> None:
        """Close all ports and connections."""
        for listening in self._listening:
            with suppress(OSError):
                listening.shutdown(socket.SHUT_RDWR)
            listening.close()
        with self._lock:
            clients = list(self._clients)
        for client in clients:
            with suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)
