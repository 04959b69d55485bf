"""A process that was killed and started again by hand: the others say so before the middleware has noticed."""

import os
import shlex
import signal
from pathlib import Path

import pytest
from support import (
    Command,
    Graph,
    Observer,
    executable,
    remove_shared_memory_left,
    ros_arguments,
    session,
    wait_for_the_end_of,
    write_scenario,
)

pytestmark = pytest.mark.long
PARAMETERS = {"run.lockstep_timeout": 1000.0}


def node(name: str, tmp_path: Path, **parameters: object) -> Command:
    return Command(executable(name, name), *ros_arguments(parameters), folder=tmp_path)


def kill(command: Command) -> None:
    command.process.send_signal(signal.SIGKILL)
    command.process.wait()
    wait_for_the_end_of([command.process.pid])


def test_simulator_that_is_killed_and_started_again_is_told_by_controller_and_recorder(tmp_path: Path) -> None:
    silent = "/afm/afm_sim_node has not published its status for 2 s: it has stopped or was killed"
    anew = "/afm/afm_sim_node publishes /afm/status again: it was restarted, or there are two nodes of that name"
    with (
        Graph() as graph,
        node("afm_controller_node", tmp_path) as controller,
        node("afm_recorder_node", tmp_path, path=str(tmp_path / "run.rrd")) as recorder,
    ):
        observer = graph.add(Observer())
        with node("afm_sim_node", tmp_path, **PARAMETERS) as simulator:
            # Two seconds of reports, so that the controller has heard one, too.
            simulator.wait_until(lambda: sum(each.ticks > 100 for each in observer.statuses) > 10, graph)
            simulator.wait_until(lambda: observer.recorder.ready, graph)
            kill(simulator)
        for each in (controller, recorder):
            each.wait_until(lambda each=each: silent in each.text, graph)
            assert anew not in each.text
        with node("afm_sim_node", tmp_path, **PARAMETERS) as simulator:
            for each in (controller, recorder):
                each.wait_until(lambda each=each: anew in each.text, graph)
                each.wait_until(lambda each=each: "/afm/afm_sim_node publishes its status again" in each.text, graph)
            for each in (simulator, controller, recorder):
                each.interrupt()
                assert each.wait(graph) == 0, each.told
    remove_shared_memory_left()


def test_controller_and_recorder_that_are_killed_and_started_again_are_told_by_the_simulator(tmp_path: Path) -> None:
    path = str(tmp_path / "run.rrd")
    with Graph() as graph, node("afm_sim_node", tmp_path, **PARAMETERS) as simulator:
        observer = graph.add(Observer())
        with (
            node("afm_controller_node", tmp_path) as controller,
            node("afm_recorder_node", tmp_path, path=path) as recorder,
        ):
            simulator.wait_until(lambda: observer.status.ticks > 100 and observer.recorder.ready, graph)
            simulator.wait_until(lambda: observer.status.controllers == ["/afm/afm_controller_node"], graph)
            simulator.wait_until(lambda: "a recorder has come" in simulator.text, graph)
            kill(controller)
            kill(recorder)
        assert "publishes piezo_drive again" not in simulator.text
        with (
            node("afm_controller_node", tmp_path) as controller,
            node("afm_recorder_node", tmp_path, path=path) as recorder,
        ):
            anew = "/afm/afm_controller_node publishes piezo_drive again: it was restarted, or there are two nodes"
            simulator.wait_until(lambda: anew in simulator.text, graph)
            ticks = observer.status.ticks
            simulator.wait_until(lambda: observer.status.ticks > ticks, graph)
            simulator.wait_until(lambda: simulator.text.count("a recorder has come") == 2, graph)
            for each in (recorder, controller):
                each.interrupt()
                assert each.wait(graph) == 0, each.told
        simulator.interrupt()
        assert simulator.wait(graph) == 0, simulator.told
    remove_shared_memory_left()


def test_controller_of_a_session_that_crashes_and_is_started_again_brings_the_run_to_its_end(tmp_path: Path) -> None:
    node = shlex.join([executable("afm_controller_node", "afm_controller_node")])
    shell = shlex.join(["sh", "-c", f'while true; do {node} "$@"; done', "sh"])
    # Seconds in which the session can see it.
    simulator = {"run.duration": 0.2, "plant.control_period": 2e-6, "run.lockstep_timeout": 1000.0}
    scenario = write_scenario(tmp_path / "scenario.yaml", afm_sim_node=simulator)
    with Graph() as graph, session(scenario, tmp_path / "out", "--controller", shell, folder=tmp_path) as command:
        observer = graph.add(Observer())
        command.wait_until(lambda: observer.status.ticks > 1000, graph)
        (victim,) = (pid for pid, line in command.descendants.items() if node in line and "while" not in line)
        os.kill(victim, signal.SIGKILL)
        assert command.wait(graph) == 0, command.text
    assert observer.status.ticks == 100_000
    assert "note: /afm/afm_controller_node was started again" in command.text
    assert (tmp_path / "out" / "scorecard.json").exists()
    remove_shared_memory_left()
