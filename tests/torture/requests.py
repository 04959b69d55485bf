"""Requests that are none, to every service and every action of the three nodes."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

from quick_lever import INSTRUMENT, LAW
from raw_requests import RawRequests, nonsense, services_of
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from support import Graph

from torture.family import Try
from torture.fuzz import node
from torture.outcome import Outcome
from torture.trio import CONTROLLER, RECORDER, SIMULATOR

REQUESTS, _AT_ONCE = 250, 25
"""To each node in one try; before it is asked something that it has to answer."""
_SETTLED = 50
"""Looks without a new service, after which they are all known."""
MOST_MEMORY = 100.0
"""What a node may have more than at first [MB]."""


class Victim:
    """A node, and all that can be asked of it."""

    def __init__(self, graph: Graph, folder: Path, namespace: str, name: str, **parameters: object) -> None:
        self.command = node(name, folder, namespace, **parameters)
        self._graph, self._name, self._namespace = graph, name, f"/{namespace}"
        self._asker = graph.add(Node("asker", namespace=namespace))
        self._client = self._asker.create_client(GetParameters, f"{self._namespace}/{name}/get_parameters")
        self._services: dict[str, RawRequests] = {}
        self._kinds: dict[str, type] = {}
        self._memory = 0.0

    def _find(self) -> None:
        """Know its services, once it answers."""
        self.command.wait_until(self._client.service_is_ready, self._graph)
        self._answers()
        looks = 0

        def settled() -> bool:
            nonlocal looks
            before, self._kinds = self._kinds, services_of(self._asker, self._name, self._namespace)
            looks = looks + 1 if before == self._kinds else 0
            return looks > _SETTLED

        self.command.wait_until(settled, self._graph)
        self._services = {service: RawRequests(self._asker, kind, service) for service, kind in self._kinds.items()}
        self.command.wait_until(lambda: all(each.heard for each in self._services.values()), self._graph)
        self._memory = self._most_memory()

    def _answers(self) -> None:
        future = self._client.call_async(GetParameters.Request(names=["use_sim_time"]))
        self.command.wait_until(future.done, self._graph)
        assert len(future.result().values) == 1, "it answers something else"

    def _most_memory(self) -> float:
        lines = Path(f"/proc/{self.command.process.pid}/status").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1024.0

    def try_one(self, rng: Random) -> None:
        """It goes on, answers, and takes no memory that was only claimed."""
        if not self._services:
            self._find()
        for number in range(REQUESTS):
            service = rng.choice(sorted(self._services))
            self._services[service].send(nonsense(rng, self._kinds[service]))
            if number % _AT_ONCE == _AT_ONCE - 1:
                self._answers()
        more = self._most_memory() - self._memory
        assert more < MOST_MEMORY, f"{self._name} has taken {more:.0f} MB"

    def end(self) -> None:
        """End the node as Ctrl-C does."""
        for each in self._services.values():
            each.close()
        self.command.process.send_signal(signal.SIGINT)
        assert self.command.wait(self._graph) == 0, self.command.text
        self._graph.remove(self._asker)


@contextmanager
def family(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
    """Nonsense to all services: no node ends, falls silent or takes memory."""
    folder.mkdir(parents=True, exist_ok=True)
    victims = (
        Victim(graph, folder, f"{namespace}_a", SIMULATOR, **INSTRUMENT, **LAW),
        Victim(graph, folder, f"{namespace}_b", CONTROLLER, **{"law.kind": "tanh"}),
        Victim(graph, folder, f"{namespace}_c", RECORDER, path=str(folder / "run.mcap")),
    )

    def one(rng: Random, outcome: Outcome) -> None:
        for each in victims:
            each.try_one(rng)
        outcome.what = f"{REQUESTS} requests to each node, less than {MOST_MEMORY:g} MB of memory"

    yield one
    for each in victims:
        each.end()
