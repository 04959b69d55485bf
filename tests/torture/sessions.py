"""A session whose runner or one of whose nodes is killed: it ends, nothing goes on running, the recording is kept."""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

from soak.run import endless
from support import Graph, processes, session, wait_for_the_end_of

from afm_node_common.shared_memory import unused, used_by
from torture.family import Make, Try
from torture.listener import Listener
from torture.outcome import Outcome
from torture.trio import REALTIME, RUNNING, has_end, lost, read, ticks_of

RUNNER = "session"


def killed(target: str) -> Make:
    """The runner, or the node of this name, is killed at a random moment."""

    @contextmanager
    def make(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
        folder.mkdir(parents=True, exist_ok=True)
        scenario = endless(REALTIME, folder / "scenario.yaml")
        number = 0

        def one(rng: Random, outcome: Outcome) -> None:
            nonlocal number
            number += 1
            name, out = f"{namespace}_{number}", folder / f"{number}"
            listener: Listener = graph.add(Listener(name, each=False))
            others = set(processes())
            try:
                with session(scenario, out, "--namespace", name, folder=folder) as command:
                    command.wait_until(lambda: listener.status.state in RUNNING and listener.recorder.ticks > 0, graph)
                    end = time.monotonic() + rng.uniform(0.1, 3.0)
                    command.wait_until(lambda: time.monotonic() > end, graph)
                    family = {pid: line for pid, line in processes().items() if pid not in others}
                    memory = {file for pid in family for file in used_by(pid)}
                    victim = next((pid for pid, line in family.items() if f"/{target} " in line), command.process.pid)
                    at = time.monotonic()
                    os.kill(victim, signal.SIGKILL)
                    code = command.wait(graph)
                    assert code == (-9 if target == RUNNER else 1), f"code {code}: {command.text}"
                    text = command.text
                    wait_for_the_end_of(family)
            finally:
                graph.remove(listener)
            outcome.left += [line for pid, line in processes().items() if pid not in others]
            outcome.left += sorted(path for path, _ in unused(memory))
            (file,) = (file for file in out.rglob("*.mcap") if file.stat().st_size)
            recording = read(file)
            outcome.lost = lost(listener, ticks_of(recording, listener), at)
            assert target == RUNNER or f"What was recorded is kept: {file}" in text, text
            kept = "whole" if has_end(recording) else "breaks off, readable"
            outcome.what = f"the recording is kept: {kept}; the rest has ended"

        yield one

    return make
