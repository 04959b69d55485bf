"""The first thing an executable runs. It imports nothing that takes time."""

import ctypes
import gc
import importlib
import io
import os
import signal
import sys
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
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # The name of a file need not be text: it is printed with escapes.
            stream.reconfigure(errors="backslashreplace")
    _bound_lengths()
    _find_place_for_logs()
    # What is loaded stays: looking for garbage among it would take a tenth of the time.
    gc.disable()
    main: Callable[[], int] = importlib.import_module(module).main
    gc.enable()
    return main()


def _bound_lengths() -> None:
    """Have the middleware check lengths that a message claims (msgs/src/cdr_bounds.cpp); before it is loaded itself."""
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        library = os.path.join(prefix, "lib", "libafm_cdr_bounds.so")
        if os.path.exists(library):
            ctypes.CDLL(library, mode=ctypes.RTLD_GLOBAL)
            return


def _find_place_for_logs() -> None:
    """ROS 2 ends a program that cannot write its logs into the home folder: then they get another place."""
    home = os.environ.get("ROS_HOME") or os.path.join(os.environ.get("HOME", ""), ".ros")
    folder = os.environ.get("ROS_LOG_DIR") or os.path.join(home, "log")
    try:
        os.makedirs(folder, exist_ok=True)
        if os.access(folder, os.W_OK):
            return
        why = "it cannot be written"
    except OSError as error:
        why = str(error.strerror)
    import tempfile

    # What this process starts finds it too, and tells nothing.
    os.environ["ROS_LOG_DIR"] = other = tempfile.mkdtemp(prefix="ros_log_")
    told = f"warning: ROS 2 cannot log into {folder} ({why}); it logs into {other}: set HOME or ROS_LOG_DIR\n"
    with suppress(OSError):
        os.write(2, told.encode())


def _leave(number: int, frame: object) -> None:
    # Nothing is open yet, and an exception would come out of some import as another one.
    with suppress(OSError):  # the terminal may be gone
        os.write(2, b"interrupted\n")
    os._exit(128 + number)
