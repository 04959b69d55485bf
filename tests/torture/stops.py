"""Nodes that stand still for seconds (SIGSTOP, SIGCONT), as on a machine that is too busy or was put to sleep."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

from support import Graph

from torture.family import Make, Try
from torture.outcome import Outcome
from torture.trio import REALTIME, RECORDER, RUNNING, SIMULATOR, Trio


def stop(name: str, scenario: str = REALTIME) -> Make:
    """A node stands still for up to five seconds; the run goes on and no recorded tick is missing untold."""

    @contextmanager
    def make(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
        trio = Trio(graph, folder, namespace, scenario)
        trio.start_all()
        listener = trio.listener

        def one(rng: Random, outcome: Outcome) -> None:
            trio.pass_time(rng.uniform(0.1, 1.0))
            before = listener.status.ticks
            at = trio.signal(name, signal.SIGSTOP)
            trio.pass_time(rng.uniform(0.2, 5.0))
            state = listener.status.state
            trio.signal(name, signal.SIGCONT)
            told = listener.when(lambda status: status.state not in RUNNING, at)
            if told is not None:
                outcome.told["status reports that no drive comes"] = told - at
            if name == SIMULATOR:
                said = listener.when_recorder(lambda status: "afm_sim_node" in status.detail, at)
                if said is not None:
                    outcome.told["recorder_status reports that the simulator is silent"] = said - at
            trio.until(lambda: listener.status.state in RUNNING and listener.status.ticks > before + 100)
            # A run at full speed may stay ahead of the recorder: what was made up to now has to come.
            made = listener.status.ticks
            trio.until(lambda: listener.recorder.ticks >= made)
            missing = listener.recorder.ticks_lost
            outcome.what = "goes on" if state in RUNNING else "held, then goes on"
            assert missing == 0 or name == RECORDER, f"{missing} ticks are lost"
            outcome.lost = 0.0 if missing == 0 else missing / listener.rate

        yield one
        trio.end_recorded()

    return make
