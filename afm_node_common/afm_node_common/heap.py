"""Memory that a process no longer needs goes back to the system, where nobody waits for a tick."""

import ctypes
import gc

_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc only


def give_back() -> None:
    """Free what refers to itself in a circle, and return what is free: some milliseconds.

    Python looks for circles by the number of objects, not by what they hold: those of a few verbs hold megabytes of
    arrays. The allocator keeps what is freed below a piece in use, so that the process grows although it needs no more.
    """
    gc.collect()
    if _trim is not None:
        _trim(0)
