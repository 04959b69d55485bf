"""Nodes as processes: help, refusals at start, a clean end."""

import os
import signal
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from support import Command, Graph, Observer, executable

from afm_model import specifications
from afm_model.parameters import Group
from afm_node_common import topics
from afm_node_common.process import ControllerNodeParameters, SimNodeParameters
from afm_node_common.runner import usage
from afm_recorder_node.parameters import RecorderParameters

NODES = {"afm_sim_node": topics.MEASUREMENT, "afm_controller_node": topics.PIEZO_DRIVE}
"""What each of them publishes."""


@pytest.mark.parametrize("model", [SimNodeParameters, ControllerNodeParameters, RecorderParameters])
def test_usage_lists_every_parameter_with_default_unit_and_what_is_allowed(model: type[Group]) -> None:
    text = usage("some_node", model)
    assert text.startswith("usage: some_node ")
    for spec in specifications(model):
        unit = "" if spec.unit == "1" else f" {spec.unit}"
        assert f"\n  {spec.name} := {spec.default}{unit}\n" in text
        assert f"{spec.description} ({spec.allowed})" in text


def start(node: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([executable(node, node), *arguments], capture_output=True, text=True, check=False)


def test_help_is_the_usage() -> None:
    shown = start("afm_controller_node", "--help")
    assert (shown.returncode, shown.stdout.strip(), shown.stderr) == (
        0,
        usage("afm_controller_node", ControllerNodeParameters),
        "",
    )


def test_what_is_refused_at_start_is_one_sentence_and_code_2(tmp_path: Path) -> None:
    cases = {
        ("-p", "run.duratoin:=1.0"): "error: unknown parameter run.duratoin: did you mean run.duration?",
        ("-p", "cantilever.W:=-1e-6"): "error: the tip does not touch the sample at rest",
        ("--params-file", str(tmp_path / "none.yaml")): f"{tmp_path / 'none.yaml'}",
        ("--", "-p", "run.mode:=realtime"): "error: unknown argument -p: parameters go after --ros-args",
    }
    with ThreadPoolExecutor(2) as pool:
        ends = list(pool.map(lambda case: start("afm_sim_node", "--ros-args", *case), cases))
    for end, (case, sentence) in zip(ends, cases.items(), strict=True):
        # rcl itself may log a line before.
        *logged, last = end.stderr.strip().splitlines()
        assert (case, end.returncode, end.stdout) == (case, 2, ""), end.stderr
        assert last.startswith("error: ")
        assert sentence in last
        assert all("[rcl]" in line for line in logged), end.stderr


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_node_ends_cleanly_when_it_is_told_to_or_its_terminal_is_closed(tmp_path: Path, number: int) -> None:
    with Graph() as graph, Command(executable("afm_sim_node", "afm_sim_node"), folder=tmp_path) as process:
        observer = graph.add(Observer())
        process.wait_until(lambda: observer.statuses, graph)
        status = Path(f"/proc/{process.process.pid}/status").read_text().split()
        caught = int(status[status.index("SigCgt:") + 1], 16)
        assert caught & 1 << number - 1, "the node does not listen to it"
        os.kill(process.process.pid, number)
        assert process.wait(graph) == 0, process.told
        assert "Traceback" not in process.text


@pytest.mark.parametrize("node", NODES)
def test_node_ends_cleanly_however_often_it_is_interrupted(tmp_path: Path, node: str) -> None:
    with Graph() as graph, Command(executable(node, node), folder=tmp_path) as process:
        observer = graph.add(Observer())
        topic = observer.resolve_topic_name(NODES[node])
        process.wait_until(lambda: observer.count_publishers(topic), graph)
        assert process.interrupt_again_and_again(graph) == 0, process.told
        assert "Traceback" not in process.text
