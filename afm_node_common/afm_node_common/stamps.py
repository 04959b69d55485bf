"""Simulated time between nanoseconds and the stamp of a message."""

from builtin_interfaces.msg import Time

NANOSECONDS = 1_000_000_000
"""In a second."""


def nanoseconds(stamp: Time) -> int:
    """Time of a stamp [ns]."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def stamp(nanoseconds: int) -> Time:
    """The stamp of a time [ns]."""
    seconds, rest = divmod(nanoseconds, NANOSECONDS)
    return Time(sec=seconds, nanosec=rest)
