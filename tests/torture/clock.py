"""The clock of the system is set, forwards or back, as the nodes see it: the machine's own is left alone.

What asks for the time, or waits until a time, in a process is put in between (clock.c). A wait that has begun before
the step ends as if there had been none.
"""

import os
import struct
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

from support import Graph

from torture.family import Make, Try
from torture.outcome import Outcome
from torture.trio import RUNNING, Trio

_LARGEST = 86_400
"""Step of the clock [s]."""


def steps(scenario: str) -> Make:
    """The clock of all three nodes is set while a run goes on."""

    @contextmanager
    def make(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
        folder.mkdir(parents=True, exist_ok=True)
        library, offset = folder / "clock.so", folder / "offset"
        source = Path(__file__).with_name("clock.c")
        subprocess.run(["cc", "-shared", "-fPIC", "-O2", "-o", library, source, "-ldl"], check=True)
        offset.write_bytes(struct.pack("<q", 0))
        environment = {"LD_PRELOAD": str(library), "CLOCK_OFFSET": str(offset)}
        trio = Trio(graph, folder, namespace, scenario, environment)
        trio.start_all()
        listener = trio.listener

        def one(rng: Random, outcome: Outcome) -> None:
            trio.pass_time(rng.uniform(0.1, 1.0))
            step = rng.choice((-1, 1)) * round(_LARGEST ** rng.random())
            before, ticks = listener.recorder.ticks, listener.status.ticks
            with offset.open("r+b") as file:
                file.write(struct.pack("<q", step))
                file.flush()
                os.fsync(file.fileno())
            trio.until(lambda: listener.recorder.ticks > before + 500 and listener.status.ticks > ticks + 500)
            assert listener.status.state in RUNNING, f"state {listener.status.state}: {listener.status.detail}"
            assert listener.recorder.ticks_lost == 0, f"{listener.recorder.ticks_lost} ticks are lost"
            outcome.what = "goes on"

        yield one
        trio.end_recorded()

    return make
