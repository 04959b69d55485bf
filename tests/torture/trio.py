"""Simulator, controller and recorder as processes, and somebody who listens."""

import os
import signal
import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import yaml
from afm_msgs.msg import InstrumentStatus
from numpy.typing import NDArray
from support import TIMEOUT, Command, Graph, executable, wait_for_the_end_of, wait_until

from afm_model.parameters.scenario_files import scenario_file
from afm_node_common.shared_memory import File, unused, used_by
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import IncompleteRecording, Recording
from torture.listener import Listener

SIMULATOR, CONTROLLER, RECORDER = NAMES = ("afm_sim_node", "afm_controller_node", "afm_recorder_node")
REALTIME, LOCKSTEP = "closed_loop_realtime", "closed_loop_tanh"
"""A tick in every millisecond of wall time; as fast as it goes."""
Ticks = NDArray[np.int64]
RUNNING = (InstrumentStatus.RUNNING,)


class Trio:
    """One instrument in a namespace of its own.

    Parameters
    ----------
    graph : Graph
        That of the listener.
    folder : Path
        For recording and output.
    namespace : str
    scenario : str
        A shipped scenario; its run gets no end.
    environment : mapping
        Of the processes, beside that of this one.
    each : bool
        Listen to each measurement; at 1 kHz that delays what else is heard.
    """

    def __init__(
        self,
        graph: Graph,
        folder: Path,
        namespace: str,
        scenario: str = REALTIME,
        environment: Mapping[str, str] | None = None,
        each: bool = False,
    ) -> None:
        # The nodes tell full paths.
        self.graph, self.folder, self.namespace = graph, folder.resolve(), namespace
        self.path = self.folder / "run.mcap"
        self._environment = dict(environment or {})
        folder.mkdir(parents=True, exist_ok=True)
        content = yaml.safe_load(scenario_file(scenario).read_text())
        run = content["/**/afm_sim_node"]["ros__parameters"].setdefault("run", {})
        run["duration"], run["lockstep_timeout"] = 0.0, 2.0
        self._parameters = folder / "parameters.yaml"
        self._parameters.write_text(yaml.safe_dump(content))
        self.listener: Listener = graph.add(Listener(namespace, each=each))
        self.commands: dict[str, Command] = {}
        self._ending: dict[str, Command] = {}
        self.seen: set[File] = set()
        """Shared memory that processes which were killed had used."""

    def start(self, *names: str) -> None:
        """Start nodes."""
        for name in names:
            arguments = ["--ros-args", "--params-file", self._parameters, "-r", f"__ns:=/{self.namespace}"]
            if name == RECORDER:
                arguments += ["-p", f"path:={self.path}", "-p", "view:=false"]
            words = ["env", *(f"{key}={value}" for key, value in self._environment.items())]
            self.commands[name] = Command(*words, executable(name, name), *arguments, folder=self.folder)

    def start_all(self) -> None:
        """Start all nodes, and wait until the run is under way and recorded."""
        self.start(*NAMES)
        self.wait_until_recorded()

    def wait_until_recorded(self) -> None:
        """Wait until a run is under way, in the file of a recorder that knows everybody."""
        since = time.monotonic()
        self.until(
            lambda: (
                self.listener.status.state in RUNNING
                and self.listener.recorder.ready
                and self.listener.recorder.ticks > 0
                and self.listener.recorded[-1][0] > since
                # Of the topics none may be ahead of the others: two blocks give the rate.
                and len(self.listener.blocks) > 1
            )
        )

    def until(self, predicate: Callable[[], object], timeout: float = TIMEOUT) -> None:
        """Spin until `predicate` holds.

        Raises
        ------
        TimeoutError
            If it does not in time.
        AssertionError
            If a node has ended by itself.
        """

        def holds() -> object:
            found = predicate()
            if not found:
                self.check_alive()
            return found

        wait_until(holds, lambda: f"{self.listener.told}; {self.printed()}", self.graph.spin, timeout)

    def pass_time(self, seconds: float) -> None:
        """Listen for some wall time."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= end, seconds + TIMEOUT)

    def check_alive(self) -> None:
        """Raise if a node has ended by itself."""
        for name, command in self.commands.items():
            assert not command.ended, f"{name} has ended by itself: {command.told}"

    def printed(self) -> str:
        """The last line that each node has printed."""
        return "; ".join(f"{name}: {command.text.strip().splitlines()[-1:]}" for name, command in self.commands.items())

    def pid(self, name: str) -> int:
        """Process id of a node."""
        return self.commands[name].process.pid

    def signal(self, name: str, number: signal.Signals) -> float:
        """Send a signal; when, in monotonic time."""
        at = time.monotonic()
        os.kill(self.pid(name), number)
        return at

    def kill(self, name: str) -> float:
        """Kill a node; when, in monotonic time. What it used of the shared memory is remembered."""
        command = self._ending.pop(name, None) or self.commands.pop(name)
        self.seen |= used_by(command.process.pid)
        at = time.monotonic()
        command.process.kill()
        command.process.wait()
        wait_for_the_end_of([command.process.pid])
        return at

    def ask_to_end(self, name: str) -> float:
        """Send a node what Ctrl-C sends, and do not expect it to live on; when, in monotonic time."""
        at = self.signal(name, signal.SIGINT)
        self._ending[name] = self.commands.pop(name)
        return at

    def end(self, *names: str, begun: bool = True) -> None:
        """End nodes as Ctrl-C does, whether they have begun or may still be starting.

        Raises
        ------
        AssertionError
            If one does not end with code 0.
        """
        commands = {name: self.commands.pop(name) for name in names or tuple(self.commands)}
        # The recorder last: it hears the others out.
        for name in sorted(commands, key=lambda name: name == RECORDER):
            self.seen |= used_by(commands[name].process.pid)
            commands[name].process.send_signal(signal.SIGINT)
            code = commands[name].wait(self.graph)
            # Asked to end before it had begun, it says so.
            assert code in ((0,) if begun else (0, 130)), f"{name} ended with code {code}: {commands[name].text}"

    def end_recorded(self) -> None:
        """End all, with a recording that is complete and lacks nothing that the listener has heard.

        Raises
        ------
        AssertionError
            If it is not, or a node does not end with code 0.
        """
        self.end()
        recording = read(self.path)
        assert recording.complete, "the recording is not complete"
        lost(self.listener, ticks_of(recording, self.listener), time.monotonic())
        self.destroy()

    def destroy(self) -> None:
        """End what still runs, and the listener."""
        for command in (*self.commands.values(), *self._ending.values()):
            command.process.kill()
            command.process.wait()
        self.commands.clear()
        self.graph.remove(self.listener)

    def shared_memory_left(self) -> list[str]:
        """Files of nodes that were killed, which nobody uses any more."""
        return sorted(path for path, _ in unused(self.seen))


def read(path: Path) -> Recording:
    """A recording, complete or not."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IncompleteRecording)
        return read_recording(path)


def has_end(recording: Recording) -> bool:
    """Whether its recorder has ended it, whatever is missing in it."""
    return "it has no end" not in recording.missing


def ticks_of(recording: Recording, listener: Listener) -> Ticks:
    """Numbers of the control ticks in a recording of the instrument that is listened to."""
    return np.round(recording.time_ticks / listener.status.control_period).astype(np.int64)


def lost(listener: Listener, ticks: Ticks, at: float) -> float:
    """Wall time before `at` whose ticks were published and are missing behind the last one of a recording [s].

    Raises
    ------
    AssertionError
        If ticks are missing in between.
    """
    if len(ticks) and ticks[-1] - ticks[0] != len(ticks) - 1:
        raise AssertionError(f"ticks are missing between {ticks[0]} and {ticks[-1]}: {len(ticks)} are there")
    since = listener.first_missing(int(ticks[-1]) if len(ticks) else -1)
    return max(0.0, at - since) if since is not None else 0.0
