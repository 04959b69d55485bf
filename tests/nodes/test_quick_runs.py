"""Runs in quick succession, of two instruments in one domain: each record holds its run, whole, and no other."""

import warnings
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from quick_lever import INSTRUMENT, LAW
from rclpy.action import ActionClient
from support import Command, Graph, Observer, executable, note_shared_memory, ros_arguments
from verbs_bench import APPROACH

from afm_model.microscope.verb import Verb
from afm_model.microscope.verbs import Scan, Withdraw
from afm_node_common import topics
from afm_node_common.verb_codec import ACTIONS, action_of, goal_of
from afm_recorder_node.reader import read_recording
from afm_recorder_node.record import open_record
from afm_recorder_node.recording import IncompleteRecording

SCAN = {"size_x": 40e-9, "size_y": 10e-9, "pixels": 8, "line_rate": 20.0, "overscan": 0.2, "speed": 5e-6}


class Lab:
    """An instrument in a process and namespace of its own, and its client."""

    def __init__(self, graph: Graph, namespace: str, folder: Path) -> None:
        self.graph, self.namespace, self.folder = graph, namespace, folder
        self.observer = graph.add(Observer(namespace=namespace))
        self.made: list[int] = []
        self._actions: dict[str, ActionClient] = {}

    def start(self, package: str, name: str, **parameters: object) -> Command:
        arguments = [*ros_arguments(parameters), "-r", f"__ns:=/{self.namespace}"]
        return Command(executable(package, name), *arguments, folder=self.folder)

    def record(self, name: str) -> Command:
        path = str(self.folder / self.namespace / name / "run.mcap")
        return self.start("afm_recorder_node", "afm_recorder_node", path=path, view=False)

    def begin(self, verb: Verb) -> Any:
        """A goal that was accepted, and the future of its result."""
        name = action_of(verb)
        if name not in self._actions:
            self._actions[name] = ActionClient(self.observer, ACTIONS[name], name)
            self.graph.spin_until(self._actions[name].server_is_ready)
        handle = self.graph.result(self._actions[name].send_goal_async(goal_of(verb)))
        assert handle.accepted
        return handle.get_result_async()

    def end(self, future: Any) -> None:
        told = self.graph.result(future).result
        assert told.success, told.message

    def reset(self) -> None:
        """Begin the next run."""
        before = self.observer.status.run_id
        assert self.observer.call(self.graph, topics.RESET).success
        self.graph.spin_until(lambda: self.observer.status.run_id != before)

    def check(self, name: str, missed: range) -> None:
        """Check that each record holds one run only, and all of it if its recorder was there all the time.

        Parameters
        ----------
        name : of the recorder
        missed : numbers of these runs
        """
        found: dict[int, int] = {}  # records of each run
        for path in sorted((self.folder / self.namespace / name).iterdir()):
            number = self.made.index(int(open_record(path).about["run_id"]))
            found[number] = found.get(number, 0) + 1
            with warnings.catch_warnings():
                warnings.simplefilter("ignore" if number in missed else "error", IncompleteRecording)
                recording = read_recording(path)
            assert len(recording.images) <= 1
            assert {image.scan.lines for image in recording.images} <= {4 + number}
            begins = [(time, text) for time, text in recording.events if text.endswith("has begun")]
            assert [text for _, text in begins[:1]] in ([], ["Approach has begun"])
            if number in missed:
                continue
            assert recording.complete and found[number] == 1
            (image,) = recording.images
            assert not any(np.isnan(values).any() for values in image.data.values())
            assert [text for _, text in begins] == [f"{verb} has begun" for verb in ("Approach", "Scan", "Withdraw")]
            assert begins[0][0] == 0.0
            ticks, samples = (np.rint(times * 1e5) for times in (recording.time_ticks, recording.time_samples))
            assert np.array_equal(ticks, 10 * np.arange(len(ticks)))
            assert np.array_equal(samples, np.arange(len(samples))) and len(samples) == 10 * len(ticks)
            assert recording.parameters["afm_sim_node"]["sample.kind"] == "patches"
        assert found.keys() >= set(range(len(self.made))) - set(missed)


@pytest.mark.parametrize("count", [6, pytest.param(100, marks=pytest.mark.long)])
def test_each_record_of_quick_runs_holds_its_run_whole_and_no_other(tmp_path: Path, count: int) -> None:
    came = count // 2  # run in which one recorder comes, and one is killed and started again
    with Graph(ros_arguments({})) as graph, ExitStack() as processes:
        labs = [Lab(graph, f"lab{k}", tmp_path) for k in (1, 2)]
        one, two = labs
        recorders = [one.record("first"), two.record("killed")]
        simulators = [lab.start("afm_sim_node", "afm_sim_node", **INSTRUMENT, **LAW) for lab in labs]
        for process in (*simulators, *recorders):
            processes.enter_context(process)
        for lab, simulator in zip(labs, simulators, strict=True):
            simulator.wait_until(lambda lab=lab: lab.observer.status.recorders == 1, graph)
        at_kill = ""
        ready = 0  # first run that all recorders have from its begin
        for number in range(count):
            for lab in labs:
                lab.made.append(lab.observer.status.run_id)
            for verb in (APPROACH, Scan(lines=4 + number, **SCAN), Withdraw()):
                under_way = [lab.begin(verb) for lab in labs]
                if number == came and isinstance(verb, Scan):
                    note_shared_memory()
                    at_kill = two.observer.recorder.path
                    recorders[1].process.kill()
                    recorders[1].process.wait()
                    recorders[1] = processes.enter_context(two.record("killed"))
                    recorders.append(processes.enter_context(one.record("late")))
                for lab, future in zip(labs, under_way, strict=True):
                    lab.end(future)
            if number == count - 3:  # whole runs are to be seen in all
                graph.spin_until(lambda: one.observer.status.recorders == 2)
                graph.spin_until(lambda: two.observer.count_subscribers("/lab2/control_trace") == 1)
                graph.spin_until(lambda: two.observer.status.recorders == 1)
            # The one that was started again has its first record, of a part of this run or of one before.
            again = two.observer.recorder.path != at_kill and two.observer.recorder.ticks > 0
            if number >= came and not ready and one.observer.status.recorders == 2 and again:
                ready = number + 1 if count > 6 else count - 2
            for lab in labs:
                lab.reset()
        for recorder in recorders:
            recorder.interrupt()
            assert recorder.wait(graph) == 0, recorder.text
    one.check("first", range(0))
    one.check("late", range(came + ready))
    # The record of the run before may be closed only half a second after its end.
    two.check("killed", range(came - 1, ready))
