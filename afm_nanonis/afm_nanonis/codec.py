"""Requests and responses as bytes: everything is big-endian. What stands where is in the table."""

import math
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from .table import CommandRow, Field

HEADER = 40
"""Bytes of the header of a request, and of a response."""
LONGEST = 1 << 24
"""Bytes of the body of a request that is read; a longer one is no request."""
_DTYPES = {"H": ">u2", "h": ">i2", "I": ">u4", "i": ">i4", "f": ">f4", "d": ">f8"}
_RANGES = {"H": (0, 2**16 - 1), "h": (-(2**15), 2**15 - 1), "I": (0, 2**32 - 1), "i": (-(2**31), 2**31 - 1)}


class ProtocolError(ValueError):
    """A request that cannot be read, or is refused; a sentence."""


class Head(NamedTuple):
    """Header of a request."""

    name: str
    field: bytes  # the name as it came, 32 bytes: the response has the same
    length: int  # of the body
    answered: bool


def head(content: bytes) -> Head:
    """Read a header of 40 bytes.

    Raises
    ------
    ProtocolError
        If the length of its body is impossible: what follows cannot be found.
    """
    length, answered = struct.unpack_from(">iH", content, 32)
    if not 0 <= length <= LONGEST:
        raise ProtocolError(f"a body of {length} bytes is not allowed: it must be 0 to {LONGEST}")
    return Head(content[:32].rstrip(b"\0").decode("latin-1"), content[:32], length, answered != 0)


class _Reader:
    """Reads numbers and texts from a body, one after the other."""

    def __init__(self, body: bytes) -> None:
        self._body, self._at = body, 0

    @property
    def over(self) -> bool:
        return self._at >= len(self._body)

    def take(self, count: int) -> bytes:
        if not 0 <= count <= len(self._body) - self._at:
            raise ProtocolError(f"its body ends after {len(self._body)} bytes, within a value")
        self._at += count
        return self._body[self._at - count : self._at]

    def numbers(self, kind: str, count: int) -> list[Any]:
        dtype = np.dtype(_DTYPES[kind])
        return list(np.frombuffer(self.take(count * dtype.itemsize), dtype).tolist())

    def count(self) -> int:
        (count,) = self.numbers("i", 1)
        if count < 0:
            raise ProtocolError(f"a count of {count} is not allowed: it must be >= 0")
        return int(count)

    def text(self) -> str:
        return self.take(self.count()).decode("utf-8", "replace")

    def value(self, field: Field, before: int) -> Any:
        if field.type == "SA":
            self.count()  # bytes of all texts: clients write something else
            return [self.text() for _ in range(self.count())]
        if field.many:
            return self.numbers(field.type, self.count() if field.many == "*" else before)
        return self.text() if field.type == "S" else self.numbers(field.type, 1)[0]


def arguments(command: CommandRow, body: bytes) -> list[Any]:
    """Read the arguments of a request, as many as it has: old clients leave out the last ones.

    Raises
    ------
    ProtocolError
        If the body ends within one.
    """
    reader, found, before = _Reader(body), list[Any](), 0
    for field in command.arguments:
        if reader.over:
            break
        found.append(reader.value(field, before))
        before = len(found[-1]) if field.many == "*" else before
    return found


def _packed(field: Field, value: Any) -> bytes:
    if field.type == "M":
        matrix = np.atleast_2d(np.asarray(value, ">f4")) if len(value) else np.zeros((0, 0), ">f4")
        return struct.pack(">ii", *matrix.shape) + matrix.tobytes()
    if field.type == "T":
        rows = [list(row) for row in value]
        columns = len(rows[0]) if rows else 0
        return struct.pack(">ii", len(rows), columns) + b"".join(_text(each) for row in rows for each in row)
    if field.type == "SA":
        texts = b"".join(_text(each) for each in value)
        return struct.pack(">ii", len(texts), len(value)) + texts
    if field.many:
        count = struct.pack(">i", len(value)) if field.many == "*" else b""
        return count + np.array([_bounded(field.type, each) for each in value], _DTYPES[field.type]).tobytes()
    if field.type == "S":
        return _text(value)
    return np.array(_bounded(field.type, value), _DTYPES[field.type]).tobytes()


def _text(text: str) -> bytes:
    encoded = text.encode("ascii", "replace")
    return struct.pack(">i", len(encoded)) + encoded


def _bounded(kind: str, value: Any) -> Any:
    if kind in "fd":
        value = float(value)
        if kind == "f" and abs(value) > 3.4e38 and not math.isinf(value):
            value = math.copysign(math.inf, value)
        return value
    low, high = _RANGES[kind]
    return min(max(int(value), low), high)


def _section(error: str) -> bytes:
    """The end of each response: whether there was an error, and its text."""
    return struct.pack(">I", 1 if error else 0) + _text(error)


def response(field: bytes, body: bytes) -> bytes:
    """A whole response, to be sent in one piece."""
    return field + struct.pack(">i", len(body)) + bytes(4) + body


def success(command: CommandRow, field: bytes, values: Sequence[Any]) -> bytes:
    """The response with the values of a command."""
    body = b"".join(_packed(each, value) for each, value in zip(command.returns, values, strict=True))
    return response(field, body + _section(""))


def failure(command: CommandRow | None, field: bytes, sentence: str, real: bool = False) -> bytes:
    """The response with an error.

    Parameters
    ----------
    command : CommandRow, optional
        None: not known.
    field : bytes
        Name in the request.
    sentence : str
    real : bool
        False: the values that are declared stand before the error, empty, so that clients which read them first find
        it. True: the error alone, as real controllers send it.
    """
    before = b"" if command is None or real else b"".join(_packed(each, each.empty) for each in command.returns)
    name = field.rstrip(b"\0").decode("latin-1").lower()
    return response(field, before + _section(" ".join(f"Error in command: {name}: {sentence}".split())))
