"""Nodes that are killed at random moments, with SIGKILL: nobody can clean up after it."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

from afm_msgs.msg import InstrumentStatus
from support import Graph

from torture.family import Make, Try
from torture.outcome import Outcome
from torture.trio import (
    CONTROLLER,
    LOCKSTEP,
    REALTIME,
    RECORDER,
    RUNNING,
    SIMULATOR,
    Trio,
    has_end,
    lost,
    read,
    ticks_of,
)

_SILENT = (InstrumentStatus.STALLED, InstrumentStatus.RETRACTED)


@contextmanager
def recorder(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
    """The recorder is killed while it records, starts or ends; the next one on the same path goes on."""
    trio = Trio(graph, folder, namespace)
    folder = trio.folder
    trio.start_all()

    def one(rng: Random, outcome: Outcome) -> None:
        moment, recorded = rng.choices(("recording", "starting", "ending"), (8, 1, 1))[0], 0.0
        if moment == "starting":
            trio.end(RECORDER, begun=False)
            for file in folder.glob("*.mcap"):
                file.unlink()
            trio.start(RECORDER)
            trio.pass_time(rng.uniform(0.0, 2.5))
            at = until = trio.kill(RECORDER)
        else:
            trio.wait_until_recorded()
            recorded = rng.uniform(0.1, 3.0)
            trio.pass_time(recorded)
            if moment == "ending":
                until = trio.ask_to_end(RECORDER)
                trio.pass_time(rng.uniform(0.0, 1.2))
                at = trio.kill(RECORDER)
            else:
                at = until = trio.kill(RECORDER)
        files = list(folder.glob("*.mcap"))
        assert len(files) <= 1, f"one run, and the records {files}"
        before = {file: file.read_bytes() for file in files}
        if moment == "starting" and not any(before.values()):
            outcome.what = "killed while starting: no run yet"
        else:
            recording = read(files[0])
            ticks = ticks_of(recording, trio.listener)
            outcome.what = f"killed while {moment}: {'whole' if has_end(recording) else 'breaks off, readable'}"
            if moment != "starting":
                outcome.lost = lost(trio.listener, ticks, until)
                # What came in the last second may be lost, the parameters too.
                assert recorded < 1.0 or recording.parameters.get("afm_sim_node"), "the parameters are missing"
        trio.start(RECORDER)
        for file, content in before.items():
            trio.until(lambda file=file: trio.listener.recorder.path not in ("", str(file)))
            outcome.told["the next recorder says where it records"] = time.monotonic() - at
            assert file.read_bytes() == content, "what was left is not what was there"
            file.unlink()

    yield one
    trio.wait_until_recorded()
    trio.end()
    (file,) = folder.glob("*.mcap")
    assert has_end(read(file)), "the last recording has no end"
    trio.destroy()


def controller(scenario: str) -> Make:
    """The controller is killed; the simulator holds on, and goes on with the next one."""

    @contextmanager
    def make(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
        trio = Trio(graph, folder, namespace, scenario)
        trio.start_all()
        listener = trio.listener

        def one(rng: Random, outcome: Outcome) -> None:
            trio.until(lambda: listener.status.state in RUNNING)
            trio.pass_time(rng.uniform(0.1, 2.0))
            at = trio.kill(CONTROLLER)
            # Started again before anybody has noticed, or after.
            if rng.random() < 0.5:
                trio.pass_time(rng.uniform(0.0, 0.5))
            else:
                trio.until(lambda: listener.status.state in _SILENT)
            trio.start(CONTROLLER)
            before = listener.status.ticks
            trio.until(lambda: listener.status.state in RUNNING and listener.status.ticks > before + 100)
            silent = listener.when(lambda status: status.state in _SILENT, at)
            if silent is not None:
                outcome.told["status reports that no drive comes"] = silent - at
            outcome.what = "the run goes on with the next controller"
            assert listener.recorder.ticks_lost == 0, "the recorder has lost ticks"

        yield one
        trio.until(lambda: listener.status.state in RUNNING)
        trio.end_recorded()

    return make


@contextmanager
def simulator(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
    """The simulator is killed; what it had published is in the recording, which is closed in order."""
    number = 0

    def prepared() -> Trio:
        nonlocal number
        number += 1
        realtime = number % 2 == 1
        scenario = REALTIME if realtime else LOCKSTEP
        trio = Trio(graph, folder / f"{number}", f"{namespace}_{number}", scenario, each=realtime)
        trio.start(CONTROLLER, RECORDER, SIMULATOR)
        return trio

    following = prepared()

    def one(rng: Random, outcome: Outcome) -> None:
        nonlocal following
        # The nodes of the next try start while this one runs.
        trio, following = following, prepared()
        try:
            if rng.random() < 0.1:
                _killed_while_it_starts(trio, rng, outcome)
            else:
                _killed_while_it_runs(trio, rng, outcome)
        finally:
            trio.destroy()
        outcome.left += trio.shared_memory_left()

    yield one
    following.destroy()


def _killed_while_it_starts(trio: Trio, rng: Random, outcome: Outcome) -> None:
    trio.pass_time(rng.uniform(0.0, 2.0))
    trio.kill(SIMULATOR)
    trio.pass_time(0.5)
    trio.end(CONTROLLER, RECORDER, begun=False)
    outcome.what = "killed while starting: the others end in order"


def _killed_while_it_runs(trio: Trio, rng: Random, outcome: Outcome) -> None:
    listener = trio.listener
    trio.wait_until_recorded()
    trio.pass_time(rng.uniform(0.1, 3.0))
    at = trio.kill(SIMULATOR)
    trio.pass_time(0.3)
    last, rate = max(listener.sequence, listener.status.ticks), listener.rate
    outcome.what = "the recording is closed in order"
    if again := rng.random() < 0.2:
        trio.until(lambda: listener.when_recorder(lambda status: "afm_sim_node" in status.detail, at))
        told = listener.when_recorder(lambda status: "afm_sim_node" in status.detail, at)
        assert told is not None
        outcome.told["recorder_status reports that the simulator is silent"] = told - at
        ticks_before = listener.recorder.ticks
        trio.start(SIMULATOR)
        trio.until(lambda: listener.status.state in RUNNING and listener.statuses[-1][0] > at)
        second = trio.path.with_stem("run-2")
        trio.until(lambda: listener.recorder.path == str(second) and listener.recorder.ticks > 0)
        outcome.what = "started again by hand: a second recording begins"
        assert ticks_before > 0
    trio.end()
    if again:
        second = read(trio.path.with_stem("run-2"))
        assert second.complete, f"the second recording is not complete: {second.missing}"
    recording = read(trio.path)
    assert has_end(recording), "the recording has no end"
    ticks = ticks_of(recording, trio.listener)
    lost(trio.listener, ticks, at)  # none is missing in between
    # Ticks that the simulator had made and not yet published as a block.
    outcome.lost = max(0, last - 1 - int(ticks[-1])) / rate
