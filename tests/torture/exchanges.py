"""Maps that are none, and names that are too long or too many, in requests for another sample."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any

from afm_msgs.srv import Exchange
from quick_lever import INSTRUMENT, LAW
from rclpy.node import Node
from support import Graph

from afm_model.sample.map_reader import SUFFIXES
from afm_node_common import topics
from afm_node_common.verb_codec import parameters
from torture.family import Try
from torture.fuzz import node
from torture.outcome import Outcome
from torture.trio import SIMULATOR

_REQUESTS = 20
_BEGINNINGS = (b"", b"\x93NUMPY\x01\0", b"GWYP", b"Gwyddion Simple Field 1.0\n", b"\x89PNG\r\n\x1a\n", b"II*\0")


def _bad(rng: Random, folder: Path) -> dict[str, Any]:
    """Parameters of a sample that cannot be."""
    match rng.randrange(4):
        case 0:
            return {f"{rng.choice('xyz') * rng.randrange(1, 30_000)}{i}": 1.0 for i in range(rng.randrange(1, 4))}
        case 1:
            return {f"name_{i}": "x" for i in range(rng.choice([2, 999, 3000]))}
        case 2:
            return {"kind": "map", "width": 1e-6, "file": rng.choice("ab/\0\u00e5") * rng.randrange(1, 9000)}
    path = folder / f"map{rng.choice(sorted(SUFFIXES))}"
    path.write_bytes(rng.choice(_BEGINNINGS) + rng.randbytes(rng.randrange(0, 2000)))
    return {"kind": "map", "width": 1e-6, "file": str(path)}


@contextmanager
def family(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
    """Each is refused in a sentence, and the next good one is put in."""
    folder.mkdir(parents=True, exist_ok=True)
    command = node(SIMULATOR, folder, namespace, **INSTRUMENT, **LAW)
    asker = graph.add(Node("asker", namespace=namespace))
    client = asker.create_client(Exchange, topics.SET_SAMPLE)
    command.wait_until(client.service_is_ready, graph)

    def ask(values: dict[str, Any]) -> Any:
        future = client.call_async(Exchange.Request(parameters=parameters(values)))
        command.wait_until(future.done, graph)
        return future.result()

    def one(rng: Random, outcome: Outcome) -> None:
        for _ in range(_REQUESTS):
            told = ask(_bad(rng, folder))
            assert not told.success
            assert 0 < len(told.message) <= 2000 and "\n" not in told.message, told.message
        told = ask({"kind": "patches", "width": rng.uniform(10e-9, 30e-9)})
        assert told.success, told.message
        outcome.what = f"{_REQUESTS} requests refused in a sentence each, the good one is answered"

    yield one
    command.process.send_signal(signal.SIGINT)
    assert command.wait(graph) == 0, command.text
    graph.remove(asker)
