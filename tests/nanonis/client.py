"""A client of the protocol that shares nothing with the server: requests and responses as bytes."""

import socket
import struct
import time
from collections.abc import Callable
from typing import Any

TIMEOUT = 60.0


class Refused(Exception):
    """The response says that there was an error."""


def until(predicate: Callable[[], object]) -> None:
    """Ask again and again, as clients do."""
    limit = time.monotonic() + TIMEOUT
    while not predicate():
        if time.monotonic() > limit:
            raise TimeoutError(f"still waiting after {TIMEOUT:g} s")


class Client:
    """One connection. Types of arguments and returns are given with each call, as letters."""

    def __init__(self, port: int, timeout: float = 60.0) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout)

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *error: object) -> None:
        self.socket.close()

    def received(self, count: int) -> bytes:
        content = b""
        while len(content) < count:
            more = self.socket.recv(count - len(content))
            if not more:
                raise ConnectionError(f"closed after {len(content)} of {count} bytes")
            content += more
        return content

    def raw(self, name: str, body: bytes = b"", answered: int = 1) -> bytes:
        """Body of the response."""
        field = name.encode().ljust(32, b"\0")
        self.socket.sendall(field + struct.pack(">iHH", len(body), answered, 0) + body)
        if not answered:
            return b""
        head = self.received(40)
        assert head[:32] == field
        assert head[36:] == bytes(4)
        return self.received(struct.unpack_from(">i", head, 32)[0])

    def call(self, name: str, types: str = "", *values: Any, returns: str = "") -> list[Any]:
        """Values of the response: numbers, `S`, `SA`, `M`, and `*` before a type for a count and so many."""
        body = b"".join(packed(kind, value) for kind, value in zip(types.split(), values, strict=True))
        body = self.raw(name, body)
        found, at = [], 0
        for kind in returns.split():
            value, at = unpacked(kind, body, at)
            found.append(value)
        status, length = struct.unpack_from(">Ii", body, at)
        assert len(body) == at + 8 + length
        if status:
            raise Refused(body[at + 8 :].decode("ascii"))
        return found


def packed(kind: str, value: Any) -> bytes:
    if kind[0] == "*":
        return struct.pack(f">i{len(value)}{kind[1]}", len(value), *value)
    if kind == "S":
        return struct.pack(">i", len(value)) + value.encode()
    if kind == "SA":
        # As a client in use: the size of all is wrong.
        return struct.pack(">ii", 4 * len(value), len(value)) + b"".join(packed("S", each) for each in value)
    return struct.pack(f">{kind}", value)


def unpacked(kind: str, body: bytes, at: int) -> tuple[Any, int]:
    if kind == "SA":
        size, count = struct.unpack_from(">ii", body, at)
        end, found = at + 8 + size, []
        at += 8
        for _ in range(count):
            text, at = unpacked("S", body, at)
            found.append(text)
        assert at == end
        return found, at
    if kind == "M":
        rows, columns = struct.unpack_from(">ii", body, at)
        numbers = struct.unpack_from(f">{rows * columns}f", body, at + 8)
        return [list(numbers[i * columns : (i + 1) * columns]) for i in range(rows)], at + 8 + 4 * rows * columns
    if kind == "T":
        assert struct.unpack_from(">ii", body, at) == (0, 0)
        return [], at + 8
    if kind[0] == "*":
        (count,) = struct.unpack_from(">i", body, at)
        values = struct.unpack_from(f">{count}{kind[1]}", body, at + 4)
        return list(values), at + 4 + struct.calcsize(f">{count}{kind[1]}")
    if kind == "S":
        (count,) = struct.unpack_from(">i", body, at)
        return body[at + 4 : at + 4 + count].decode("ascii"), at + 4 + count
    (value,) = struct.unpack_from(f">{kind}", body, at)
    return value, at + struct.calcsize(f">{kind}")
