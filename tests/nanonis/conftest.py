"""A microscope behind the protocol, in this process."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from afm_model.microscope import Live, Microscope
from afm_nanonis.front import Front
from afm_nanonis.server import Server

from .client import Client, until


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Remarks of verbs are warnings in Python, and have no place in the protocol."""
    for item in items:
        if item.path.parent == Path(__file__).parent:
            item.add_marker(pytest.mark.filterwarnings("ignore::UserWarning"))


class Served:
    """A server with its microscope; every test has a connection of its own."""

    def __init__(
        self, folder: Path, factor: float = 5.0, scenario: str = "two_materials", engaged: bool = True, **groups: Any
    ) -> None:
        run = {"mode": "realtime", "real_time_factor": factor}
        # Stripes of two materials, narrow enough for quick scans.
        self.microscope = Microscope(scenario, engaged=engaged, run=run, sample={"width": 100e-9}, **groups)
        assert isinstance(self.microscope.backend, Live)
        self.front = Front(self.microscope, self.microscope.backend.instrument.parameters, folder)
        self.server = Server(self.front, (0, 0, 0, 0), 0)

    def client(self, number: int = 0) -> Client:
        return Client(self.server.ports[number])

    def close(self) -> None:
        self.server.close()
        self.front.close()
        self.microscope.close()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    made = Served(tmp_path_factory.mktemp("session"))
    yield made
    made.close()
    assert not made.microscope.state.near


@pytest.fixture
def client(served: Served) -> Iterator[Client]:
    with served.client() as made:
        yield made


@pytest.fixture
def engaged(served: Served, client: Client) -> Client:
    """A client whose tip is on the sample, feedback on."""
    client.call("ZCtrl.OnOffSet", "I", 1)
    served.front.jobs.wait(served.front.jobs._begun)
    # A loop that was held comes back to the sample by itself.
    until(lambda: client.call("ZCtrl.OnOffGet", returns="I") == [1] and served.microscope.state.approached)
    return client
