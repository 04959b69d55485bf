"""Simulated time between nanoseconds and the stamp of a message."""

from builtin_interfaces.msg import Time

from .decoding import NANOSECONDS


def stamp(nanoseconds: int) -> Time:
    """The stamp of a time [ns]."""
    seconds, rest = divmod(nanoseconds, NANOSECONDS)
    return Time(sec=seconds, nanosec=rest)
