"""What the tests of nodes and of sessions share: nodes in this process, processes of their own, and waiting for either.

Nothing here imitates the product: nodes talk over real topics, waiting means spinning until a predicate holds.
"""

import os
import re
import select
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import rclpy
import yaml
from afm_msgs.msg import InstrumentStatus, RecorderStatus, Score
from ament_index_python.packages import get_package_prefix
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from afm_node_common import topics
from afm_node_common.shared_memory import File, remove_unused, shared_memory_cleanup, unused, used_by

ROOT = Path(__file__).resolve().parent.parent
TIMEOUT = 120.0
"""Wall time that anything may take on a busy machine [s]; no test waits so long unless it fails."""
MARK = "AFM_TEST_RUN"
"""Environment variable by which every process of this test run is known."""

# What a process leaves behind.

_PORTS = re.compile(r"fast(?:dds|rtps)_port(\d+)")
_seen: set[File] = set()
_looked_at = 0.0


def processes() -> dict[int, str]:
    """Living processes of this test run but this one: id and command line."""
    found = {}
    for pid in map(int, filter(str.isdigit, os.listdir("/proc"))):
        with suppress(OSError):
            if pid != os.getpid() and _is_ours(pid):
                line = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode().strip()
                # Python's own: it lives as long as the process that has used several processes once.
                if "multiprocessing.resource_tracker" not in line:
                    found[pid] = line
    return found


def _is_ours(pid: int) -> bool:
    """Whether a process carries the mark of this test run: no other run, in whatever clone, has the same."""
    try:
        return f"{MARK}={os.environ[MARK]}".encode() in Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    except OSError:
        return False


def note_shared_memory(*, at_once: bool = True) -> None:
    """Remember the shared memory that this run uses now; not more often than five times a second unless `at_once`."""
    global _looked_at
    if not at_once and time.monotonic() < _looked_at + 0.2:
        return
    _looked_at = time.monotonic()
    for pid in (os.getpid(), *processes()):
        _seen.update(used_by(pid))


def shared_memory_left() -> list[str]:
    """Files that this run has made and that nobody uses any more; call it with no graph of one's own."""
    for file in Path("/dev/shm").iterdir():
        if _PORTS.search(file.name) and of_this_run(str(file)):
            with suppress(OSError):
                _seen.add((str(file), file.stat().st_ino))
    return sorted(path for path, _ in unused(_seen) if of_this_run(path))


def of_this_run(path: str) -> bool:
    """Whether nobody else takes this file of the shared memory: a segment, or a port of this run's domain.

    Ports below 7400 belong to no domain: any node that starts tries them one after the other, and for that moment one
    that was left looks used, or has been made again.
    """
    port = _PORTS.search(path)
    first = 7400 + 250 * int(os.environ["ROS_DOMAIN_ID"])
    return not port or first <= int(port[1]) < first + 250


def remove_shared_memory_left() -> None:
    """For a test that kills a process with SIGKILL, which nobody can clean up after."""
    shared_memory_left()  # also finds what was made anew under an old name: peers go on writing to a dead one
    remove_unused(_seen)


# Waiting.


def wait_until(
    predicate: Callable[[], object], told: Callable[[], object], spin: Callable[[], object], timeout: float = TIMEOUT
) -> None:
    """Spin until `predicate` holds; raise with what `told` says if it does not within `timeout` [s]."""
    limit = time.monotonic() + timeout
    while not predicate():
        if time.monotonic() > limit:
            raise TimeoutError(f"still waiting after {timeout:g} s; last state: {told()}")
        note_shared_memory(at_once=False)
        spin()


def wait_for_the_end_of(pids: Iterable[int]) -> None:
    """Wait until these processes have ended, children of this one or not."""
    for pid in pids:
        with suppress(ProcessLookupError):
            handle = os.pidfd_open(pid)
            try:
                if not select.select([handle], [], [], TIMEOUT)[0]:
                    raise TimeoutError(f"still running after {TIMEOUT:g} s: {processes().get(pid, pid)}")
            finally:
                os.close(handle)


def end_all_processes() -> dict[int, str]:
    """End what this run has left running, with its shared memory; what that was."""
    left = processes()
    if left:
        note_shared_memory()
        for pid in left:
            kill(pid)
        wait_for_the_end_of(left)
        remove_shared_memory_left()
    return left


def kill(pid: int) -> None:
    """SIGKILL for a process of this test run; nothing happens to any other that has got its number by now."""
    with suppress(ProcessLookupError):
        handle = os.pidfd_open(pid)
        try:
            # By the handle, which stays that of the process looked at.
            if _is_ours(pid):
                signal.pidfd_send_signal(handle, signal.SIGKILL)
        finally:
            os.close(handle)


# Nodes in this process.


def ros_arguments(parameters: Mapping[str, object]) -> list[str]:
    """Command-line arguments that set parameters."""
    arguments = ["--ros-args"]
    for name, value in parameters.items():
        arguments += ["-p", f"{name}:={yaml.safe_dump(value, default_flow_style=True).splitlines()[0]}"]
    return arguments


def write_scenario(path: Path, **sections: Mapping[str, object]) -> Path:
    """Write a parameter file: for each node its parameters, with dotted names."""
    content = {
        name if name == "scenario" else f"/**/{name}": {"ros__parameters": dict(parameters)}
        for name, parameters in sections.items()
    }
    path.write_text(yaml.safe_dump(content))
    return path


def _destroy(node: Any) -> None:
    """Destroy a node with its action clients.

    rclpy leaves them. One that a failed test still holds keeps the participant alive, to which all later tests of this
    process then send.
    """
    node.destroy_node()
    for client in [entity for entity in node.waitables if isinstance(entity, ActionClient)]:
        client.destroy()


class Graph:
    """Nodes of this process, served in turn by one thread. Use as a context manager.

    Parameters
    ----------
    arguments : sequence of str
        For every node made in here, as on a command line; see `ros_arguments`.
    rest : float
        Wall time for which a turn waits for something to do [s]; a message ends it at once. Where a node has a loop of
        its own, which takes its messages itself, 2 ms at most.
    """

    def __init__(self, arguments: Sequence[str] = (), rest: float = 0.02) -> None:
        # Ctrl-C is Python's: it ends what waits, and the nodes in order.
        rclpy.init(args=list(arguments), signal_handler_options=SignalHandlerOptions.NO)
        self.executor = SingleThreadedExecutor()
        self.nodes: list[Any] = []
        self._rest = rest

    def __enter__(self) -> "Graph":
        return self

    def __exit__(self, *_: object) -> None:
        note_shared_memory()
        with shared_memory_cleanup():
            self.executor.shutdown()
            for node in self.nodes:
                _destroy(node)
            rclpy.shutdown()

    def add(self, node: Any) -> Any:
        """Serve a node from now on."""
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def remove(self, node: Any) -> None:
        """End a node."""
        self.nodes.remove(node)
        self.executor.remove_node(node)
        _destroy(node)

    def spin(self) -> None:
        """One turn: a step of every node that has a loop of its own, and what the executor has."""
        looping = [node for node in self.nodes if hasattr(node, "step")]
        busy = [node.step() for node in looping]
        for node in looping:
            node.serve_periodic()
        rest = min(self._rest, 0.002) if looping else self._rest
        self.executor.spin_once(timeout_sec=0.0 if any(busy) else rest)

    def spin_until(self, predicate: Callable[[], object]) -> None:
        """Spin until `predicate` holds."""
        wait_until(predicate, lambda: [getattr(node, "told", node.get_name()) for node in self.nodes], self.spin)

    def result(self, future: Any) -> Any:
        """Spin until an answer is there."""
        self.spin_until(future.done)
        return future.result()


class Observer(Node):
    """Listens to an instrument and calls its services."""

    def __init__(self, name: str = "observer", namespace: str = topics.NAMESPACE) -> None:
        super().__init__(name, namespace=namespace)
        self.status, self.recorder = InstrumentStatus(), RecorderStatus()
        self.statuses: list[InstrumentStatus] = []
        self.scores: list[Score] = []
        self.create_subscription(InstrumentStatus, topics.STATUS, self._on_status, topics.LATCHED_QOS)
        self.create_subscription(RecorderStatus, topics.RECORDER_STATUS, self._on_recorder, topics.LATCHED_QOS)
        self.create_subscription(Score, topics.SCORE, self.scores.append, topics.LATCHED_QOS)
        self._clients_of_services = {
            name: self.create_client(Trigger, name) for name in (topics.PLAY, topics.PAUSE, topics.RESET)
        }

    @property
    def told(self) -> object:
        """For messages of tests that fail."""
        return self.status, self.recorder

    def _on_status(self, message: InstrumentStatus) -> None:
        self.status = message
        self.statuses.append(message)

    def _on_recorder(self, message: RecorderStatus) -> None:
        self.recorder = message

    def call(self, graph: Graph, service: str) -> Trigger.Response:
        """Call play, pause or reset."""
        client = self._clients_of_services[service]
        graph.spin_until(client.service_is_ready)
        return graph.result(client.call_async(Trigger.Request()))


# Processes.


def executable(package: str, name: str) -> str:
    """An installed executable, as `ros2 run` finds it."""
    return str(Path(get_package_prefix(package)) / "lib" / package / name)


class Command:
    """A process of this test run, in a process group of its own as in a terminal. Use as a context manager.

    Parameters
    ----------
    command : program and arguments
    folder : where its output is kept
    """

    def __init__(self, *command: str | Path, folder: Path) -> None:
        self._output = folder / f"{Path(command[0]).name}.{time.monotonic_ns()}.output"
        with self._output.open("wb") as file:
            self.process = subprocess.Popen(
                [str(part) for part in command],
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def __enter__(self) -> "Command":
        return self

    def __exit__(self, *_: object) -> None:
        """Whatever a test left running, it does not outlive it."""
        if not self.ended:
            note_shared_memory()
            tree = [self.process.pid, *self.descendants]
            self.process.kill()
            for pid in tree[1:]:
                kill(pid)
            self.process.wait()
            wait_for_the_end_of(tree)
            remove_shared_memory_left()

    @property
    def text(self) -> str:
        """What it has printed."""
        return self._output.read_text(errors="replace")

    @property
    def told(self) -> str:
        """For messages of tests that fail."""
        return f"code {self.process.poll()}, printed: {self.text}"

    @property
    def ended(self) -> bool:
        """Whether the process has ended."""
        return self.process.poll() is not None

    @property
    def descendants(self) -> dict[int, str]:
        """Living processes that it has started, and those that these have started: id and command line."""
        alive, parents = processes(), dict[int, int]()
        for pid in alive:
            with suppress(OSError):
                parents[pid] = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
        # Not in the order of their numbers: these begin anew at 32768.
        family = more = {self.process.pid}
        while more:
            more = {pid for pid, parent in parents.items() if parent in family} - family
            family |= more
        return {pid: alive[pid] for pid in family & set(alive) if pid != self.process.pid}

    def interrupt(self) -> None:
        """What Ctrl-C in a terminal does: SIGINT to the process group."""
        note_shared_memory()
        os.killpg(self.process.pid, signal.SIGINT)

    def interrupt_again_and_again(self, graph: Graph | None = None) -> int:
        """What somebody does who has no patience: Ctrl-C until it has ended. Exit code."""

        def insist() -> None:
            os.killpg(self.process.pid, signal.SIGINT)
            self._wait_a_moment()
            if graph:
                graph.spin()

        self.interrupt()
        wait_until(lambda: self.ended, lambda: self.told, insist)
        return int(self.process.returncode)

    def wait_until(self, predicate: Callable[[], object], graph: Graph | None = None, timeout: float = TIMEOUT) -> None:
        """Wait until `predicate` holds; fail at once if the process ends before."""

        def holds() -> bool:
            if predicate():
                return True
            assert not self.ended, f"it has ended: {self.told}"
            return False

        wait_until(holds, lambda: self.told, graph.spin if graph else self._wait_a_moment, timeout)

    def wait(self, graph: Graph | None = None, timeout: float = TIMEOUT) -> int:
        """Exit code, once it has ended."""
        wait_until(lambda: self.ended, lambda: self.told, graph.spin if graph else self._wait_a_moment, timeout)
        return int(self.process.returncode)

    def _wait_a_moment(self) -> None:
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(0.02)


def session(scenario: str | Path, out: Path, *options: str, folder: Path, picture: bool = False) -> Command:
    """`ros2 run afm_bringup session SCENARIO --out OUT`, with a picture only where a test looks at it."""
    drawn = () if picture else ("--no-picture",)
    return Command(executable("afm_bringup", "session"), scenario, "--out", out, *drawn, *options, folder=folder)


def assert_nothing_left() -> None:
    """Neither a process nor shared memory of one that has ended cleanly."""
    assert processes() == {}
    assert shared_memory_left() == []
