"""What the operating system grants is in force for the loop's thread alone; what it refuses costs one warning."""

import os
import subprocess
import sys
import threading
from pathlib import Path

from afm_node_common import scheduling
from afm_node_common.process import Process


def applied(process: Process) -> tuple[list[str], set[int], int]:
    """Warnings, processors and policy of a thread that asked for `process`."""
    result: list[tuple[list[str], set[int], int]] = []

    def ask() -> None:
        warnings: list[str] = []
        scheduling.apply(process, warnings.append)
        result.append((warnings, os.sched_getaffinity(0), os.sched_getscheduler(0)))

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join()
    return result[0]


def test_nothing_asked_changes_nothing() -> None:
    assert applied(Process()) == ([], os.sched_getaffinity(0), os.SCHED_OTHER)


def test_thread_alone_is_bound_to_the_processor() -> None:
    before = os.sched_getaffinity(0)
    one = max(before)
    warnings, there, _ = applied(Process(cpu=one))
    assert (warnings, there) == ([], {one})
    assert os.sched_getaffinity(0) == before


def test_processor_that_is_not_there_costs_a_warning() -> None:
    (warning,), there, _ = applied(Process(cpu=4095))
    assert warning.startswith("process.cpu = 4095 cannot be had: there are ")
    assert there == os.sched_getaffinity(0)


def test_priority_is_granted_or_its_refusal_told() -> None:
    warnings, _, policy = applied(Process(fifo_priority=1))
    if policy == os.SCHED_FIFO:
        assert warnings == []
    else:
        assert policy == os.SCHED_OTHER
        assert warnings == [
            "process.fifo_priority = 1 is not permitted (allow it: ulimit -r 99, or CAP_SYS_NICE); going on without"
        ]
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_threads_that_bring_messages_come_before_the_loop() -> None:
    there, over, found = threading.Event(), threading.Event(), []

    def listen(name: str) -> None:
        # As Fast DDS names them.
        Path(f"/proc/self/task/{threading.get_native_id()}/comm").write_text(name)
        there.set()
        over.wait()
        found.append((name, os.sched_getscheduler(0), os.sched_getparam(0).sched_priority))

    threads = []
    for name in ("dds.shm.7412", "dds.shm.wdog", "dds.ev.0"):
        there.clear()
        threads.append(threading.Thread(target=listen, args=(name,)))
        threads[-1].start()
        there.wait()
    warnings, _, policy = applied(Process(fifo_priority=1))
    over.set()
    for thread in threads:
        thread.join()
    granted = (os.SCHED_FIFO, 2) if policy == os.SCHED_FIFO else (os.SCHED_OTHER, 0)
    assert dict((name, rest) for name, *rest in found) == {
        "dds.shm.7412": [*granted],
        "dds.shm.wdog": [os.SCHED_OTHER, 0],
        "dds.ev.0": [os.SCHED_OTHER, 0],
    }
    assert (policy == os.SCHED_FIFO) is (not warnings)


def test_ordinary_threads_leave_the_processor_of_a_loop_with_priority() -> None:
    there, over = threading.Event(), threading.Event()

    def wait() -> None:
        there.set()
        over.wait()

    other = threading.Thread(target=wait)
    before = os.sched_getaffinity(0)
    one = max(before)
    other.start()
    there.wait()
    _, bound, policy = applied(Process(fifo_priority=1, cpu=one))
    moved = [os.sched_getaffinity(thread) for thread in (other.native_id, threading.main_thread().native_id) if thread]
    for task in Path("/proc/self/task").iterdir():
        os.sched_setaffinity(int(task.name), before)
    over.set()
    other.join()
    assert bound == {one}
    granted = policy == os.SCHED_FIFO and len(before) > 1
    assert moved == [before - {one} if granted else before] * 2


def test_memory_is_locked_or_its_refusal_told() -> None:
    # In a process of its own: what is locked stays so.
    code = (
        "from afm_node_common.process import Process; from afm_node_common import scheduling; w = []; "
        "scheduling.apply(Process(lock_memory=True), w.append); "
        "locked = [line for line in open('/proc/self/status') if line.startswith('VmLck')]; print(len(w), *locked)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    warned, locked = int(said[0]), int(said[2])
    assert (warned, locked > 0) in [(0, True), (1, False)]
