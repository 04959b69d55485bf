"""`ros2 run afm_bringup contained COMMAND ...`: run a command, and leave nothing running that it has started.

`ros2 launch` signals only the process that it has started. What that process has started, such as a controller that a
shell script runs, goes on. This program stands between the two. It runs the command as a session does: when it is
asked to end, or the command ends, or the launch has been killed, everything that the command has started is ended.
"""

import os
import signal
import sys
import time

from .processes import Processes

_LOOK_PERIOD = 0.05
"""Wall time between two looks at the command [s]."""


def main() -> int:
    """Entry point.

    Returns
    -------
    int
        Exit code of the command; 128 and the number of the signal that has killed it; 0 if it was asked to end.
    """
    command = sys.argv[1:]
    if not command or command[0] in ("-h", "--help"):
        print("usage: contained COMMAND ...", file=sys.stderr)
        return 2
    parent, asked = os.getppid(), list[int]()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # nohup has a program ignore SIGHUP: that stays.
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda *received: asked.append(received[0]))
    try:
        with Processes(last="") as processes:
            processes.start(command[0], command)
            while processes.ended() is None and not asked and os.getppid() == parent:
                time.sleep(_LOOK_PERIOD)
            processes.note_shared_memory()
            code = processes.code
    except OSError as error:
        print(f"error: {command[0]} could not be started: {error.strerror}", file=sys.stderr)
        return 127
    return 0 if code is None else code if code >= 0 else 128 - code
