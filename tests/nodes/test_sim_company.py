"""Two simulators on the same topics: no run of either is what it seems, and both say so."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from afm_msgs.msg import InstrumentStatus, Measurement, PiezoDrive
from hand_controller import HandController, answer
from support import Command, Graph, Observer, executable, ros_arguments

from afm_model.run import RunState
from afm_sim_node.node import SimNode

PARAMETERS = {
    "plant.control_period": 1e-4,
    "detector.sample_period": 1e-4,
    "run.real_time_factor": 0.02,
    "run.watchdog_timeout": 1000.0,
    "run.lockstep_timeout": 1000.0,
}


def gentle(measurement: Measurement) -> list[PiezoDrive]:
    return [answer(measurement, 0.0, 0.0)]


def sentence(*names: str) -> str:
    return (
        f"{' and '.join(names)} publish /afm/measurement: a controller answers them all and no run is what it seems; "
        "end all but one, or give each a namespace"
    )


@contextmanager
def two(mode: str) -> Iterator[Graph]:
    with Graph(ros_arguments(PARAMETERS | {"run.mode": mode})) as graph:
        yield graph


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_second_simulator_that_joins_ends_the_run_and_does_not_start(mode: str) -> None:
    both = sentence("/afm/afm_sim_node (2 nodes of this name)")
    with two(mode) as graph:
        observer = graph.add(Observer())
        graph.add(HandController(gentle))
        first = graph.add(SimNode())
        graph.spin_until(lambda: first.run.instrument.ticks > 20)
        second = graph.add(SimNode())
        graph.spin_until(lambda: first.run.state == RunState.FAULT)
        assert first.run.snapshot().detail == both
        graph.spin_until(lambda: second.run.snapshot().detail)
        told = second.run.snapshot()
        assert (told.state, told.ticks, told.detail) == (RunState.WAITING, 0, both)
        for state in (InstrumentStatus.FAULT, InstrumentStatus.WAITING):
            graph.spin_until(lambda state=state: (state, both) in {(s.state, s.detail) for s in observer.statuses})
        # A reset does not help while both are there; the second one starts as soon as it is alone.
        first.run.reset()
        graph.spin_until(lambda: first.run.snapshot().detail == both)
        assert first.run.state == RunState.WAITING
        graph.remove(first)
        graph.spin_until(lambda: second.run.instrument.ticks > 20)
        assert second.run.snapshot().detail == ""


def test_simulators_that_are_there_together_start_neither() -> None:
    with two("lockstep") as graph:
        controller = graph.add(HandController(gentle))
        pair = [graph.add(SimNode()), graph.add(SimNode())]
        graph.spin_until(lambda: all(node.run.snapshot().detail for node in pair))
        assert [node.run.state for node in pair] == [RunState.WAITING, RunState.WAITING]
        assert controller.seen == []


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_second_simulator_in_a_process_of_its_own_is_named(mode: str, tmp_path: Path) -> None:
    program = executable("afm_sim_node", "afm_sim_node")
    arguments = [*ros_arguments(PARAMETERS | {"run.mode": mode}), "-r", "__node:=other_instrument"]
    both = sentence("/afm/afm_sim_node", "/afm/other_instrument")
    with two(mode) as graph:
        graph.add(HandController(gentle))
        first = graph.add(SimNode())
        graph.spin_until(lambda: first.run.instrument.ticks > 20)
        with Command(program, *arguments, folder=tmp_path) as other:
            other.wait_until(lambda: first.run.state == RunState.FAULT, graph)
            assert first.run.snapshot().detail == both
            # Whether it had begun before it saw the first one or not, it says so too.
            other.wait_until(lambda: both in other.text, graph)
            other.interrupt()
            assert other.wait(graph) == 0, other.told


def test_simulator_in_another_namespace_is_no_rival(tmp_path: Path) -> None:
    program = executable("afm_sim_node", "afm_sim_node")
    with two("lockstep") as graph:
        graph.add(HandController(gentle))
        elsewhere = graph.add(Observer("elsewhere", namespace="/other"))
        first = graph.add(SimNode())
        with Command(program, "--ros-args", "-r", "__ns:=/other", folder=tmp_path) as other:
            other.wait_until(lambda: len(elsewhere.statuses) > 10, graph)
            ticks = first.run.instrument.ticks
            other.wait_until(lambda: first.run.instrument.ticks > ticks + 20, graph)
            assert first.run.state == RunState.RUNNING
            assert (elsewhere.status.state, elsewhere.status.detail) == (InstrumentStatus.WAITING, "")
            other.interrupt()
            assert other.wait(graph) == 0, other.told
