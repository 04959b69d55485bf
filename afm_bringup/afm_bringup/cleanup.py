"""A process that ends whatever a session has left running, however the session itself ended.

It runs as `python cleanup.py MARK` and sees the end of the session because its standard input closes.
The processes of a session carry a mark in their environment. Children inherit it, also if a shell starts them,
in the background or as a daemon.
"""

import os
import select
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

VARIABLE = "AFM_SESSION"
"""Environment variable that holds the mark."""
_PATIENCE = {signal.SIGINT: 10.0, signal.SIGTERM: 5.0, signal.SIGKILL: 5.0}
"""Signals in the order in which they are sent, and the wall time to wait after each [s]."""


def end_marked(mark: str) -> None:
    """End every process that carries `mark`, and those that they start meanwhile."""
    for number, patience in _PATIENCE.items():
        limit = time.monotonic() + patience
        sent: set[int] = set()
        while handles := _marked(mark):
            for pid, handle in handles.items():
                if pid not in sent:
                    with suppress(ProcessLookupError, PermissionError):
                        signal.pidfd_send_signal(handle, number)
                    sent.add(pid)
            left = limit - time.monotonic()
            if left > 0.0:
                # A handle becomes readable when its process has ended.
                select.select(list(handles.values()), [], [], min(left, 0.2))
            for handle in handles.values():
                os.close(handle)
            if left <= 0.0:
                break
        else:
            return


def _marked(mark: str) -> dict[int, int]:
    """Living processes that carry `mark`: id and a handle, which a later process of the same id does not have."""
    wanted = f"{VARIABLE}={mark}".encode()
    found: dict[int, int] = {}
    for entry in filter(str.isdigit, os.listdir("/proc")):
        pid = int(entry)
        if pid == os.getpid():
            continue
        try:
            handle = os.pidfd_open(pid)
        except OSError:
            continue
        with suppress(OSError):
            # Empty for a process that has ended and is not yet waited for.
            if wanted in Path(f"/proc/{pid}/environ").read_bytes().split(b"\0"):
                found[pid] = handle
                continue
        os.close(handle)
    return found


def main() -> None:
    """Wait for the end of the session, then end what is left of it."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    while os.read(0, 1):
        pass
    end_marked(sys.argv[1])


if __name__ == "__main__":
    main()
