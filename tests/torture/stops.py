"""Nodes that stand still for seconds (SIGSTOP, SIGCONT), as on a machine that is too busy or was put to sleep."""

import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

from support import Command, Graph, remove_shared_memory_left

from torture.family import Make, Try
from torture.outcome import Outcome
from torture.trio import LOCKSTEP, REALTIME, RECORDER, RUNNING, SIMULATOR, Trio

_SUBSCRIBER = """
import sys, rclpy
from afm_msgs.msg import Measurement
rclpy.init()
node = rclpy.create_node("bystander", namespace=sys.argv[1])
subscription = node.create_subscription(Measurement, "measurement", lambda _: None, 10)
rclpy.spin(node)
"""
"""Receives measurements reliably, as a plot or a controller in waiting does, and answers nothing."""


@contextmanager
def subscriber(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
    """A subscriber of `measurement` stands still for seconds; the run goes on, slower, and the status names it."""
    trio = Trio(graph, folder, namespace, LOCKSTEP)
    trio.start_all()
    listener = trio.listener
    with Command(sys.executable, "-c", _SUBSCRIBER, namespace, folder=folder) as bystander:
        infos = listener.get_subscriptions_info_by_topic
        bystander.wait_until(lambda: any(i.node_name == "bystander" for i in infos(f"/{namespace}/measurement")), graph)

        def one(rng: Random, outcome: Outcome) -> None:
            trio.pass_time(rng.uniform(0.1, 1.0))
            before, at = listener.status.ticks, time.monotonic()
            bystander.process.send_signal(signal.SIGSTOP)
            try:
                trio.until(lambda: listener.when(lambda status: "bystander" in status.warning, at))
                trio.pass_time(rng.uniform(0.2, 3.0))
            finally:
                bystander.process.send_signal(signal.SIGCONT)
            outcome.told["status names the subscriber"] = listener.when(lambda s: "bystander" in s.warning, at) - at
            trio.until(lambda: listener.status.ticks > before + 100 and "bystander" not in listener.status.warning)
            made = listener.status.ticks
            trio.until(lambda: listener.recorder.ticks >= made)
            assert listener.recorder.ticks_lost == 0, f"{listener.recorder.ticks_lost} ticks are lost"
            outcome.what = "goes on"

        yield one
    trio.end_recorded()
    # Queues that the middleware made for it, one after the other.
    remove_shared_memory_left()


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
