"""How long a session waits for its nodes: for one that does nothing a while, for one that computes much longer."""

import sys
import time
from pathlib import Path

import pytest
from support import TIMEOUT

from afm_bringup import session_start
from afm_bringup.monitor import Monitor
from afm_bringup.processes import Processes
from afm_bringup.session_start import SessionError, Start

PROGRAMS = {"sleeps": "import time; time.sleep(1000)", "computes": "while True: pass"}


@pytest.mark.parametrize("does", PROGRAMS)
def test_limit_of_the_start_counts_time_in_which_the_nodes_do_nothing(
    does: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_start, "_SAY_PERIOD", 0.1)
    monkeypatch.setattr(session_start, "_START_TIMEOUT", 1.0)
    with Processes(last="") as processes, Monitor("session", "start") as monitor:
        processes.start("node", [sys.executable, "-c", PROGRAMS[does]], tmp_path / "log")
        start = Start(processes, monitor, lambda **_: False, external=False)
        begun = time.monotonic()
        # A limit of 1 s of wall time would be over long before.
        enough = 5.0
        if does == "computes":
            start._wait_for(lambda: time.monotonic() > begun + enough, lambda: "the simulator")
        else:
            with pytest.raises(SessionError, match=r"waited .* s for the simulator"):
                start._wait_for(lambda: time.monotonic() > begun + TIMEOUT, lambda: "the simulator")
