"""The stand-in for `ros2` runs what the README tells, in an environment that has no ros2cli."""

import os
import runpy
import shlex
import subprocess
from pathlib import Path
from typing import Any

import pytest
from afm_msgs.action import MoveTo, Verb
from afm_msgs.srv import Exchange, Step
from rclpy.action import ActionServer
from rclpy.node import Node
from support import ROOT, Command, Graph, executable

from afm_node_common.decoding import values_of

PACKAGES = {
    "afm_sim_node": {"afm_sim_node"},
    "afm_controller_node": {"afm_controller_node"},
    "afm_recorder_node": {"afm_recorder_node", "inspect", "repair", "view"},
    "afm_bringup": {"session"},
    "afm_nanonis": {"server"},
}


def ros2(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [str(ROOT / "tools" / "bin" / "ros2"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """An installed package whose executable tells its arguments and ends with code 7; another file is no executable."""
    index = tmp_path / "share" / "ament_index" / "resource_index" / "packages"
    index.mkdir(parents=True)
    (index / "told").write_text("")
    folder = tmp_path / "lib" / "told"
    folder.mkdir(parents=True)
    (folder / "tell").write_text('#!/bin/sh\nfor argument; do echo "<$argument>"; done\nexit 7\n')
    (folder / "tell").chmod(0o755)
    (folder / "notes.txt").write_text("")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path), prepend=os.pathsep)
    return "told"


def test_run_passes_arguments_and_exit_code_through(package: str) -> None:
    arguments = ["--ros-args", "-p", "name:=two words", "--", "", "$HOME *"]
    end = ros2("run", package, "tell", *arguments)
    assert (end.returncode, end.stderr) == (7, "")
    assert end.stdout.splitlines() == [f"<{argument}>" for argument in arguments]


def test_unknown_package_and_executable_are_told_in_a_sentence(package: str) -> None:
    for arguments, sentence in (
        (("run", "no_such_package", "tell"), "error: package no_such_package not found"),
        (("run", "No/Package", "tell"), "error: package No/Package not found"),
        (("run", package, "telll"), "error: told has no executable telll; it has: tell"),
        (("run", package, "notes.txt"), "error: told has no executable notes.txt; it has: tell"),
    ):
        end = ros2(*arguments)
        assert (end.returncode, end.stdout, end.stderr.strip()) == (1, "", sentence)


def test_every_executable_of_the_readme_is_listed_and_is_the_installed_one() -> None:
    end = ros2("pkg", "executables")
    assert end.returncode == 0, end.stderr
    listed = {tuple(line.split()) for line in end.stdout.splitlines()}
    for package, names in PACKAGES.items():
        assert {(package, name) for name in names} <= listed
        for name in names:
            assert os.access(executable(package, name), os.X_OK)
    assert ros2("pkg", "executables", "afm_bringup").stdout.splitlines() == sorted(
        f"afm_bringup {name}" for package, name in listed if package == "afm_bringup"
    )


def test_service_call_fills_the_request_and_prints_the_answer() -> None:
    def serve(request: Step.Request, response: Step.Response) -> Step.Response:
        response.message = f"{request.ticks} asked for"
        return response

    with Graph() as graph:
        graph.add(Node("stand_in_server")).create_service(Step, "/stand_in/step", serve)
        command = [str(ROOT / "tools" / "bin" / "ros2"), "service", "call", "/stand_in/step", "afm_msgs/srv/Step"]
        with subprocess.Popen([*command, "{ticks: 7}"], stdout=subprocess.PIPE, text=True) as process:
            graph.spin_until(lambda: process.poll() is not None)
            assert process.stdout is not None
            assert process.stdout.read() == "afm_msgs.srv.Step_Response(success=False, message='7 asked for')\n"
    assert process.returncode == 0


@pytest.mark.parametrize(
    ("kind", "request_text", "sentence"),
    [
        ("std_srvs/srv/Trgger", "{}", "there is no service type std_srvs/srv/Trgger: it must be of the form "),
        ("afm_msgs/srv/Step", "{tics: 3}", "there is no field tics; there is: ticks"),
        ("afm_msgs/srv/Step", "{ticks: -3}", "ticks = -3 is not allowed: it must be a uint64"),
        ("afm_msgs/srv/Step", "3", "the request = 3 is not allowed: it must be like {field: value}"),
        ("afm_msgs/srv/Step", "{", "the request '{' is no YAML: it must be like '{field: value}'"),
    ],
)
def test_service_call_refuses_a_request_that_does_not_fit(kind: str, request_text: str, sentence: str) -> None:
    end = ros2("service", "call", "/stand_in/step", kind, request_text)
    assert (end.returncode, end.stdout) == (1, "")
    assert end.stderr.startswith(f"error: {sentence}")


def test_parameter_is_set_and_read(tmp_path: Path) -> None:
    def run(*arguments: str) -> tuple[int, str]:
        with Command(ROOT / "tools" / "bin" / "ros2", "param", *arguments, folder=tmp_path) as command:
            return command.wait(graph), command.text.strip()

    with Graph() as graph:
        node = graph.add(Node("stand_in_parameters"))
        node.declare_parameter("gain", 1.0)
        assert run("set", "/stand_in_parameters", "gain", "2.5") == (0, "Set parameter successful")
        assert node.get_parameter("gain").value == 2.5
        assert run("get", "/stand_in_parameters", "gain") == (0, "value is: 2.5")
        code, said = run("set", "/stand_in_parameters", "gain", "high")
        assert code == 1 and said.startswith("error: gain was not set: Wrong parameter type")
        assert run("get", "/stand_in_parameters", "gian") == (1, "error: /stand_in_parameters has no parameter gian")


@pytest.mark.parametrize(
    ("page", "command", "kind", "given"),
    [
        ("verbs.md", "ros2 service call /afm/set_sample", Exchange.Request, {"kind": "patches", "width": 4e-7}),
        ("extending.md", "ros2 action send_goal /afm/verb", Verb.Goal, {"size": 40e-9, "lift": 20e-9}),
    ],
)
def test_parameters_are_filled_in_as_the_docs_show(page: str, command: str, kind: Any, given: dict[str, Any]) -> None:
    (line,) = (line for line in (ROOT / "docs" / page).read_text().splitlines() if command in line)
    request = runpy.run_path(str(ROOT / "tools" / "bin" / "ros2"))["read"](kind(), shlex.split(line)[-1], "request")
    (field,) = (name for name, of in kind.get_fields_and_field_types().items() if of.startswith("sequence<"))
    assert values_of(getattr(request, field)) == given


def test_action_is_listed_and_a_goal_is_sent_with_its_feedback_and_result(tmp_path: Path) -> None:
    def move(goal: Any) -> MoveTo.Result:
        goal.succeed()
        return MoveTo.Result(success=True, x=goal.request.x)

    goals: list[Any] = []
    goal_sent = ("send_goal", "/stand_in/move_to", "afm_msgs/action/MoveTo", "{x: 1e-9}", "--feedback")
    program = ROOT / "tools" / "bin" / "ros2"
    told = []
    with Graph() as graph:
        node = graph.add(Node("stand_in_server"))
        server = ActionServer(node, MoveTo, "/stand_in/move_to", move, handle_accepted_callback=goals.append)
        for arguments in (("list", "-t"), ("info", "/stand_in/move_to"), goal_sent):
            with Command(program, "action", *arguments, folder=tmp_path) as command:

                def shown(command: Command = command) -> bool:
                    """Whether the client has shown feedback. What a server says before both have found each other gets
                    lost: as a microscope does, it says how far it is again and again."""
                    goals[0].publish_feedback(MoveTo.Feedback(progress=0.5, detail="moving"))
                    return "detail='moving'" in command.text

                if "--feedback" in arguments:
                    command.wait_until(lambda: goals, graph)
                    command.wait_until(shown, graph)
                    assert "Goal finished" not in command.text
                    goals[0].execute()
                assert command.wait(graph) == 0, command.told
                told.append(command.text)
        server.destroy()
    assert "/stand_in/move_to [afm_msgs/action/MoveTo]" in told[0]
    assert "Action servers: 1\n    /stand_in_server" in told[1]
    assert "detail='moving'" in told[2] and "x=1e-09" in told[2]
    assert told[2].endswith("Goal finished with status: SUCCEEDED\n")


def test_what_it_does_not_know_is_answered_with_what_it_does() -> None:
    for arguments in ((), ("topic", "list"), ("run", "afm_sim_node")):
        end = ros2(*arguments)
        assert end.returncode == 1
        assert "ros2 run PACKAGE EXECUTABLE" in end.stderr
