"""The first thing an executable runs. It imports nothing that takes time."""

import gc
import importlib
import os
import signal
from collections.abc import Callable
from contextlib import suppress


def start(module: str) -> int:
    """Import `module` and return what its `main` returns. A Ctrl-C meanwhile ends the process without a traceback.

    Loading takes a second or two, and Python's own answer to SIGINT is a traceback out of the middle of an import.
    """
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # nohup has a program ignore SIGHUP: that stays.
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _leave)
    # What is loaded stays: looking for garbage among it would take a tenth of the time.
    gc.disable()
    main: Callable[[], int] = importlib.import_module(module).main
    gc.enable()
    return main()


def _leave(number: int, frame: object) -> None:
    # Nothing is open yet, and an exception would come out of some import as another one.
    with suppress(OSError):  # the terminal may be gone
        os.write(2, b"interrupted\n")
    os._exit(128 + number)
