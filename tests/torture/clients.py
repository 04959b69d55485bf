"""Clients of a microscope that are killed, or stand still, in the middle of a verb."""

import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

from quick_lever import INSTRUMENT, LAW
from support import TIMEOUT, Command, Graph

from afm_bringup.remote import Remote
from afm_model.microscope.results import COMPLETE
from afm_model.microscope.verbs import Approach, Scan, Withdraw
from afm_node_common.shared_memory import remove_unused, unused, used_by
from torture.family import Try
from torture.fuzz import node
from torture.outcome import Outcome
from torture.trio import SIMULATOR

_APPROACH = Approach(rate=10e-6, range=2e-6, settle=2e-3)
_SCAN = Scan(size_x=40e-9, size_y=10e-9, pixels=8, lines=4, line_rate=20.0, overscan=0.2, speed=5e-6)
_MORTAL = f"""
import sys
from afm_bringup.remote import Remote
from afm_model.microscope.verbs import Scan
Remote(sys.argv[1], patience={TIMEOUT}).execute(
    Scan(size_x=40e-9, size_y=10e-9, pixels=8, lines=8000, line_rate=20.0, overscan=0.2, speed=5e-6))
"""


@contextmanager
def family(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
    """Its verb is cancelled with the tip withdrawn, and the scan of the next client comes to its end."""
    folder.mkdir(parents=True, exist_ok=True)
    command = node(SIMULATOR, folder, namespace, **INSTRUMENT, **LAW)
    remote = Remote(namespace, patience=TIMEOUT)

    def until_doing(name: str) -> None:
        assert remote._remote.spin_until(lambda: remote._remote.status.doing == name, TIMEOUT), command.text

    def one(rng: Random, outcome: Outcome) -> None:
        done = remote.execute(_APPROACH)
        assert done.status == COMPLETE, done.message
        with Command(sys.executable, "-c", _MORTAL, namespace, folder=folder) as mortal:
            until_doing("Scan")
            end = time.monotonic() + rng.uniform(0.0, 1.0)
            remote._remote.spin_until(lambda: time.monotonic() > end, TIMEOUT)
            memory = used_by(mortal.process.pid) - used_by("self")
            mortal.process.send_signal(rng.choice([signal.SIGKILL, signal.SIGSTOP]))
            at = time.monotonic()
            until_doing("")
            outcome.told["microscope reports that the client has gone"] = time.monotonic() - at
            assert "its client has gone; the tip is withdrawn" in remote._remote.status.last
            done = remote.execute(_APPROACH)
            assert done.status == COMPLETE, done.message
            done = remote.execute(_SCAN)
            assert (done.status, done.result.complete) == (COMPLETE, True), done.message
        assert remote.execute(Withdraw()).status == COMPLETE
        outcome.left = sorted(path for path, _ in unused(memory))
        remove_unused(memory)
        outcome.what = "its verb is cancelled, the scan of the next client is complete"

    try:
        yield one
    finally:
        remote.close()
    command.process.send_signal(signal.SIGINT)
    assert command.wait(graph) == 0, command.text
