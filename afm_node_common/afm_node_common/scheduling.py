"""What the operating system grants a control loop: exact timers, priority, a processor, memory that stays."""

import ctypes
import os
import re
import resource
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

from .process import Process

_PR_SET_TIMERSLACK = 29
_MCL_CURRENT, _MCL_FUTURE = 1, 2
_libc = ctypes.CDLL(None, use_errno=True)

_LISTENER = re.compile(r"dds\.shm\.\d+")
"""Names that Fast DDS gives to its threads that take messages out of shared memory."""


def apply(process: Process, warn: Callable[[str], object]) -> None:
    """Apply the settings of `process` to the calling thread; `warn` is called for each one that is refused.

    Call it when all other threads exist: those started later would inherit the priority.
    """
    # By default the kernel may wake a sleeper 50 us late, to wake several at once.
    _libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    if process.lock_memory:
        # A limit would later make ordinary allocations fail.
        limited = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] != resource.RLIM_INFINITY and os.geteuid() != 0
        if limited or _libc.mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
            warn("process.lock_memory: memory cannot be locked here (allow it: ulimit -l unlimited); going on without")
    everywhere = os.sched_getaffinity(0)
    if process.cpu >= 0:
        _bind([0], {process.cpu}, warn)
    if process.fifo_priority > 0:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(process.fifo_priority))
            _raise_listeners(process)
            if process.cpu >= 0 and everywhere - {process.cpu}:
                # The system gives threads that wait for the loop's processor 50 ms of each second.
                _bind(filter(_is_ordinary, _threads()), everywhere - {process.cpu}, warn)
        except OSError:
            warn(
                f"process.fifo_priority = {process.fifo_priority} is not permitted "
                "(allow it: ulimit -r 99, or CAP_SYS_NICE); going on without"
            )


def _bind(threads: Iterable[int], cpus: set[int], warn: Callable[[str], object]) -> None:
    try:
        for thread in threads:
            with suppress(ProcessLookupError):
                os.sched_setaffinity(thread, cpus)
    except OSError:
        there = ", ".join(map(str, sorted(os.sched_getaffinity(0))))
        warn(f"process.cpu = {', '.join(map(str, cpus))} cannot be had: there are {there}; going on without")


def _is_ordinary(thread: int) -> bool:
    """Whether a thread has no priority; one that has ended has none to be bound for."""
    with suppress(ProcessLookupError):
        return os.sched_getscheduler(thread) == os.SCHED_OTHER
    return False


def _threads() -> list[int]:
    """Of this process."""
    return [int(task.name) for task in Path("/proc/self/task").iterdir()]


def _raise_listeners(process: Process) -> None:
    """Give the middleware's threads through which a drive or a measurement comes one priority more than the loop."""
    for thread in _threads():
        with suppress(OSError):
            if _LISTENER.fullmatch(Path(f"/proc/self/task/{thread}/comm").read_text().strip()):
                os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(process.fifo_priority + 1))
                if process.cpu >= 0:
                    os.sched_setaffinity(thread, {process.cpu})
