"""Claims about requests that no client of ours sends: each is answered or dropped, and the simulator goes on."""

import signal
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from afm_msgs import action
from afm_msgs.msg import MicroscopeStatus
from afm_msgs.srv import Exchange, SetFeedback
from quick_lever import INSTRUMENT, LAW
from raw_requests import RawRequests
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.node import Node
from support import Command, Graph, executable, ros_arguments

from afm_node_common import topics
from afm_node_common.shared_memory import used_by
from afm_node_common.verb_codec import parameters

EVIL = "import pathlib\npathlib.Path({mark!r}).touch()\nraise SystemExit('ended by a message')\n"
FAILS = """
import builtins, dataclasses
from pydantic import Field
import patches

class Parameters(patches.Patches):
    error: str = Field("", description="what is raised")

def values(parameters):
    if parameters.sample.error:
        raise getattr(builtins, parameters.sample.error)("of a part")
    return patches.values(parameters)

SAMPLE = dataclasses.replace(patches.PATCHES, name="fails", parameters=Parameters, values=values)
"""
PARTS = Path(__file__).parents[2] / "examples" / "parts"


@dataclass
class Server:
    """A simulator as a process that works in a folder of its own, and a client."""

    command: Command
    graph: Graph
    client: Node
    folder: Path

    def call(self, kind: Any, service: str, **values: Any) -> Any:
        client = self.client.create_client(kind, f"/afm/{service}")
        self.command.wait_until(client.service_is_ready, self.graph)
        future = client.call_async(kind.Request(**values))
        self.command.wait_until(future.done, self.graph)
        self.client.destroy_client(client)
        return future.result()

    def exchange(self, **values: str | float) -> str:
        found = self.call(Exchange, topics.SET_SAMPLE, parameters=parameters(values))
        assert found.success == (not found.message)
        return str(found.message)

    @property
    def memory(self) -> float:
        """Most that it has had [MB]."""
        lines = Path(f"/proc/{self.command.process.pid}/status").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1024.0


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    folder = tmp_path
    (folder / "evil.py").write_text(EVIL.format(mark=str(folder / "mark")))
    (folder / "patches.py").write_text((PARTS / "patches.py").read_text())
    (folder / "fails.py").write_text(FAILS)
    arguments = ros_arguments(INSTRUMENT | LAW | {"process.parts": "patches:PATCHES, fails:SAMPLE"})
    command = ("env", "-C", folder, executable("afm_sim_node", "afm_sim_node"), *arguments)
    with Graph() as graph, Command(*command, folder=folder) as running:
        states: list[Any] = []
        client = graph.add(Node("asks"))
        client.create_subscription(MicroscopeStatus, "/afm/microscope", states.append, topics.LATCHED_QOS)
        running.wait_until(lambda: states, graph)
        yield Server(running, graph, client, folder)
        # Whatever was asked, it ends as it should.
        running.process.send_signal(signal.SIGINT)
        assert running.wait(graph) == 0, running.told


def test_bad_maps_are_refused_in_a_sentence_and_the_simulator_goes_on(server: Server) -> None:
    nested = b"GWYP" + b"".join(b"C\0" + struct.pack("<I", 99999) + b"o\0o" for _ in range(3000))
    for name, content in {"empty.npy": b"", "nested.gwy": nested, "empty.png": b"", "x" * 5000 + ".npy": None}.items():
        if content is not None:
            (server.folder / name).write_bytes(content)
        told = server.exchange(kind="map", file=str(server.folder / name), width=1e-6)
        assert "cannot be read as a height map: " in told or "there is no file" in told
        assert len(told) < 1000
    assert server.exchange(kind="flat") == ""


def test_message_runs_no_code_but_chooses_parts_that_were_named_at_start(server: Server) -> None:
    assert "evil:X was not loaded when the node started" in server.exchange(kind="evil:X")
    kind = Parameter(name="law.kind", value=ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="evil:X"))
    (result,) = server.call(SetParameters, "afm_sim_node/set_parameters", parameters=[kind]).results
    assert not result.successful
    assert "evil:X was not loaded when the node started" in result.reason
    verb = ActionClient(server.client, action.Verb, "/afm/verb")
    server.command.wait_until(verb.server_is_ready, server.graph)
    goal = server.graph.result(verb.send_goal_async(action.Verb.Goal(verb="evil:X")))
    assert "evil:X was not loaded" in server.graph.result(goal.get_result_async()).result.message
    verb.destroy()
    assert not (server.folder / "mark").exists()
    assert server.exchange(kind="patches:PATCHES", width=5e-9) == ""


def test_whatever_a_service_leads_to_is_answered_and_the_simulator_goes_on(server: Server) -> None:
    for error in ("SystemExit", "KeyboardInterrupt", "MemoryError", "RecursionError", "KeyError"):
        told = server.exchange(kind="fails:SAMPLE", error=error)
        assert error in told, told
        assert "of a part" in told
        assert "\n" not in told
    assert server.exchange(kind="fails:SAMPLE", width=5e-9) == ""


def test_terminal_commands_and_line_ends_of_a_request_come_back_as_escapes(server: Server) -> None:
    bad = "on\x1b[2J\n[ERROR] all is lost"
    kind = Parameter(name="law.kind", value=ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=bad))
    other = Parameter(name=bad, value=ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=bad))
    verb = ActionClient(server.client, action.Verb, "/afm/verb")
    server.command.wait_until(verb.server_is_ready, server.graph)
    goal = server.graph.result(verb.send_goal_async(action.Verb.Goal(verb=bad)))
    told = [
        server.exchange(kind=bad),
        server.exchange(kind="map", file=bad, width=1e-6),
        server.exchange(**{bad: 1.0}),
        server.call(SetFeedback, topics.SET_FEEDBACK, mode=bad).message,
        *(
            result.reason
            for each in (kind, other)
            for result in server.call(SetParameters, "afm_sim_node/set_parameters", parameters=[each]).results
        ),
        server.graph.result(goal.get_result_async()).result.message,
    ]
    verb.destroy()
    for sentence in told:
        assert sentence.isprintable() and "\\x1b[2J" in sentence, told
    assert "\x1b[2J" not in server.command.text and "\n[ERROR]" not in server.command.text


CLAIM = struct.pack("<I", 2**24)
CLAIMS = (
    (SetParameters.Request, "/afm/afm_sim_node/set_parameters", CLAIM + bytes(16)),
    (GetParameters.Request, "/afm/afm_sim_node/get_parameters", CLAIM + bytes(4)),
    (Exchange.Request, f"/afm/{topics.SET_SAMPLE}", CLAIM + bytes(16)),
    (action.ScanPath.Impl.SendGoalService.Request, "/afm/scan_path/_action/send_goal", bytes(16) + CLAIM),
)


def test_requests_that_are_or_claim_to_be_long_take_neither_time_nor_memory(server: Server) -> None:
    before = server.memory
    for kind, service, data in CLAIMS:
        requests = RawRequests(server.client, kind, service)
        server.command.wait_until(lambda requests=requests: requests.heard, server.graph)
        for _ in range(3):
            requests.send(b"\0\1\0\0" + data)
        assert server.call(GetParameters, "afm_sim_node/get_parameters", names=["run.duration"]).values
        requests.close()
    assert server.memory < before + 50.0
    # The others are those of this test, which is no node of ours.
    private = used_by(server.command.process.pid) - used_by("self")
    assert private
    assert {Path(path).stat().st_mode & 0o777 for path, _ in private} == {0o600}
    names = [f"name_{i}" for i in range(100_000)]
    told = server.call(GetParameters, "afm_sim_node/get_parameters", names=names)
    assert not told.values
    told = server.call(Exchange, topics.SET_SAMPLE, parameters=[Parameter(name=name) for name in names[:2000]])
    assert told.message == "parameters with 2000 entries is not allowed: it must have at most 1000"
    told = server.call(Exchange, topics.SET_SAMPLE, parameters=parameters({"file": "x" * 1_000_000}))
    assert told.message == "string_value with 1000000 letters is not allowed: it must have at most 10000"
    told = server.exchange(**{9000 * "x": 1.0})
    assert told.startswith("unknown parameter sample.xxx") and "\n" not in told and len(told) <= 2000
    many = [Parameter(name=name) for name in names[:2000]]
    results = server.call(SetParameters, "afm_sim_node/set_parameters", parameters=many).results
    assert {(result.successful, result.reason) for result in results} == {
        (False, "parameters with 2000 entries is not allowed: it must have at most 1000")
    }
