"""A microscope on topics as `Remote` meets it on bad days: a caller that fails, a simulator started anew, a pause."""

import math
import os
import signal
import time
from collections.abc import Iterator
from functools import partial

import pytest
from quick_lever import INSTRUMENT, LAW
from std_srvs.srv import Trigger
from support import TIMEOUT, Graph, ros_arguments
from verbs_bench import APPROACH, ENDLESS

from afm_bringup import remote, remote_node
from afm_bringup.remote import Remote
from afm_model.core.errors import ParameterError, VerbError
from afm_model.microscope.image import Line
from afm_model.microscope.results import CANCELLED, COMPLETE, FAILED, Calibration, Progress
from afm_model.microscope.verbs import FrictionLoop, MoveZ
from afm_model.run import RunState
from afm_node_common import topics
from afm_sim_node.node import SimNode


class Served:
    """A simulator and its client in one thread: each turn of the client is one of the simulator."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.simulator = graph.add(SimNode())
        self.limit = time.monotonic() + TIMEOUT
        self.client = Remote(check=self.turn)
        self.then = self.nothing

    def nothing(self) -> None:
        """What is done once, with the first line of a scan."""

    def turn(self) -> None:
        if time.monotonic() > self.limit:
            raise TimeoutError("the client waits for ever")
        self.graph.spin()

    def on_line(self, line: Line) -> None:
        do, self.then = self.then, self.nothing
        do()

    def start_anew(self) -> None:
        self.graph.remove(self.simulator)
        self.simulator = self.graph.add(SimNode())

    def approach(self) -> None:
        self.limit = time.monotonic() + TIMEOUT
        if not self.simulator.run.operator.state.approached:
            assert self.client.execute(APPROACH).message == ""

    def wait_for_rest(self) -> None:
        self.graph.spin_until(lambda: not self.simulator.run.operator.busy)
        assert not self.simulator.run.operator.state.near


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    with Graph(ros_arguments(INSTRUMENT | LAW)) as graph:
        made = Served(graph)
        yield made
        made.limit = time.monotonic() + TIMEOUT
        made.client.close()


def test_what_the_caller_raises_cancels_the_verb_and_withdraws_the_tip(served: Served) -> None:
    served.approach()

    def fail() -> None:
        raise ZeroDivisionError

    served.then = fail
    with pytest.raises(ZeroDivisionError):
        served.client.execute(ENDLESS, on_line=served.on_line)
    served.wait_for_rest()


def test_second_interrupt_leaves_a_paused_run_and_its_tip_is_withdrawn_behind_the_pause(served: Served) -> None:
    served.approach()

    def pause() -> None:
        served.simulator.run.pause()
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)

    served.then = pause
    with pytest.raises(KeyboardInterrupt) as raised:
        served.client.execute(ENDLESS, on_line=served.on_line)
    assert raised.type is KeyboardInterrupt
    assert (served.simulator.run.state, served.simulator.run.operator.busy) == (RunState.PAUSED, True)
    served.simulator.run.play()
    served.wait_for_rest()


def test_a_scan_that_its_callback_stops_pauses_or_breaks_off_keeps_its_lines(served: Served) -> None:
    client, run = served.client, served.simulator.run
    seen: list[Line] = []

    def on_line(line: Line) -> None:
        seen.append(line)
        if len(seen) == 2:
            client.pause()
        elif len(seen) == 4:
            raise KeyboardInterrupt

    def on_progress(progress: Progress) -> None:
        if run.state == RunState.PAUSED:
            client.resume()

    served.approach()
    with pytest.raises(KeyboardInterrupt):
        client.execute(ENDLESS, on_progress, on_line)
    assert client.outcome is not None
    assert client.outcome.status == CANCELLED
    assert client.outcome.result.lines_done >= 2
    served.wait_for_rest()
    served.approach()
    seen.clear()

    def stop(line: Line) -> None:
        seen.append(line)
        client.stop()

    outcome = client.execute(ENDLESS, on_line=stop)
    assert (outcome.status, outcome.message) == (CANCELLED, "Scan was cancelled; the tip is withdrawn")
    # It may have stopped in the middle of a line, with a trace and no retrace.
    assert {line.number for line in seen} <= set(outcome.result.times)
    assert seen
    assert outcome.result.lines_done < ENDLESS.lines
    served.wait_for_rest()


@pytest.mark.parametrize(("stalls", "late", "said"), [(0.3, 60.0, "was cancelled"), (math.inf, 0.3, "was broken off")])
def test_a_scan_that_is_broken_off_was_cancelled_also_if_the_answer_is_late_or_does_not_come(
    served: Served, monkeypatch: pytest.MonkeyPatch, stalls: float, late: float, said: str
) -> None:
    monkeypatch.setattr(remote, "SETTLED", 0.0)
    monkeypatch.setattr(remote, "_LATE", late)
    goes_on, seen = 0.0, list[Line]()

    def turn() -> None:
        if time.monotonic() > goes_on:
            served.turn()

    def break_off(line: Line) -> None:
        nonlocal goes_on
        seen.append(line)
        if len(seen) == 4:
            goes_on = time.monotonic() + stalls
            raise KeyboardInterrupt

    served.approach()
    monkeypatch.setattr(served.client._remote, "_check", turn)
    with pytest.raises(KeyboardInterrupt):
        served.client.execute(ENDLESS, on_line=break_off)
    assert served.client.outcome is not None
    assert served.client.outcome.status == CANCELLED
    assert said in served.client.outcome.message
    assert served.client.outcome.result.lines_done >= 2
    goes_on = 0.0
    served.wait_for_rest()


def test_simulator_that_ends_in_good_order_answers_its_goal(served: Served) -> None:
    served.approach()
    served.then = lambda: served.simulator.finish(lambda timeout: served.graph.executor.spin_once(timeout))
    outcome = served.client.execute(ENDLESS, on_line=served.on_line)
    assert (outcome.status, outcome.message) == (FAILED, "the simulator was ended")


def test_microscope_that_is_started_anew_during_a_verb_is_told_as_ended(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    served.approach()
    monkeypatch.setattr(remote_node, "GONE", 0.1)
    served.then = served.start_anew
    with pytest.raises(VerbError, match="the microscope has ended while Scan was being done"):
        served.client.execute(ENDLESS, on_line=served.on_line)
    # The new one takes verbs of the same client.
    served.approach()


def test_a_calibration_is_put_in_use_as_in_process_and_named_by_results(served: Served) -> None:
    served.approach()
    believed = served.simulator.get_parameter("detector.lateral_sensitivity").value
    served.client.use(Calibration(1.5 * believed, 0.0, "N/V"))
    loop = served.client.execute(FrictionLoop(length=10e-9, line_rate=10.0)).result
    assert (loop.lateral_sensitivity, loop.deflection_sensitivity) == (1.5 * believed, 10e-9)
    served.client.use(lateral_sensitivity=0.0)
    again = served.client.execute(FrictionLoop(length=10e-9, line_rate=10.0)).result
    assert abs(loop.lateral).max() == pytest.approx(1.5 * abs(again.lateral).max(), rel=0.01)


def test_scan_that_is_stopped_keeps_its_tip_on_the_sample_and_the_next_verb_goes_on(served: Served) -> None:
    served.approach()
    served.then = partial(served.client.stop, stay=True)
    outcome = served.client.execute(ENDLESS, on_line=served.on_line)
    assert (outcome.status, outcome.message) == (CANCELLED, "Scan was stopped; the tip stays on the sample")
    assert outcome.result.lines_done < ENDLESS.lines
    state = served.simulator.run.operator.state
    assert (state.approached, state.near, state.feedback) == (True, True, "on")
    assert served.client.execute(FrictionLoop(length=10e-9, line_rate=20.0)).status == COMPLETE


def test_z_is_held_moved_limited_and_read_over_topics(served: Served) -> None:
    served.approach()
    client = served.client
    client.set_feedback("hold")
    z = client.read_signals("z", "deflection")
    assert {name: each.unit for name, each in z.items()} == {"z": "m", "deflection": "m"}
    assert client.execute(MoveZ(z=z["z"].value - 5e-9)).result.z == pytest.approx(z["z"].value - 5e-9, abs=1e-15)
    client.set_z_limits(high=z["z"].value + 10e-9)
    assert served.simulator.run.instrument.parameters.onboard.high == z["z"].value + 10e-9
    refused = client.execute(MoveZ(z=z["z"].value + 11e-9))
    assert refused.status == FAILED and "z must be within" in refused.message
    client.set_z_limits(high=5e-6)
    with pytest.raises(ParameterError, match="there is no signal colour; there are "):
        client.read_signals("colour")
    assert len(client.read_signals()) > 10
    client.set_feedback("on")


def test_nothing_that_is_done_cannot_be_stopped(served: Served) -> None:
    with pytest.raises(ParameterError, match="nothing is being done: there is nothing to stop"):
        served.client._remote.ask(Trigger, topics.STOP_VERB)
