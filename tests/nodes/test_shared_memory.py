"""Shared memory of the middleware: kept while somebody uses it, removed when its user was killed."""

import fcntl
import os
import time
import uuid
from pathlib import Path

from support import Command, Graph, Observer, executable, of_this_run, wait_for_the_end_of

from afm_node_common import topics
from afm_node_common.shared_memory import old, remove_stray, remove_unused, unused, used_by


def test_what_a_killed_node_leaves_is_removed_and_nothing_before(tmp_path: Path) -> None:
    with Graph() as graph, Command(executable("afm_sim_node", "afm_sim_node"), folder=tmp_path) as node:
        observer = graph.add(Observer())
        topic = observer.resolve_topic_name(topics.MEASUREMENT)
        node.wait_until(lambda: observer.count_publishers(topic), graph)
        files = {file for file in used_by(node.process.pid) if of_this_run(file[0])}
        assert any("port" in path for path, _ in files)
        remove_unused(files)
        assert unused(files) == set()
        assert all(Path(path).exists() for path, _ in files)
        node.process.kill()
        wait_for_the_end_of([node.process.pid])
        left = unused(files)
        assert left
        remove_unused(files)
        assert unused(files) == set()
    for path, _ in left:
        assert not list(Path("/dev/shm").glob(f"*{Path(path).name}*"))


def test_a_file_made_again_under_the_same_name_is_another_one(tmp_path: Path) -> None:
    path = Path("/dev/shm/fastrtps_0123456789abcdef")
    path.touch()
    try:
        file = (str(path), path.stat().st_ino + 1)
        assert unused({file}) == set()
        remove_unused({file})
        assert path.exists()
    finally:
        path.unlink()


def test_what_killed_nodes_of_other_runs_have_left_is_removed_and_what_is_new_or_locked_is_not() -> None:
    paths = {name: Path(f"/dev/shm/fastrtps_{uuid.uuid4().hex[:16]}") for name in ("left", "new", "locked")}
    locks = {name: Path(f"{path}_el") for name, path in paths.items()}
    try:
        for path in (*paths.values(), *locks.values()):
            path.touch()
        long_ago = time.time() - 100.0
        for name in ("left", "locked"):
            os.utime(paths[name], (long_ago, long_ago))
            os.utime(locks[name], (long_ago, long_ago))
        with locks["locked"].open() as owner:
            fcntl.flock(owner, fcntl.LOCK_EX)
            ours = {str(path) for path in paths.values()}
            remove_unused({file for file in old() if file[0] in ours})
            assert {name for name, path in paths.items() if path.exists()} == {"new", "locked"}
            assert {name for name, path in locks.items() if path.exists()} == {"new", "locked"}
    finally:
        for path in (*paths.values(), *locks.values()):
            path.unlink(missing_ok=True)


def test_locks_and_mutexes_without_their_file_are_removed_after_a_minute_and_others_are_not() -> None:
    folder, name = Path("/dev/shm"), f"fastrtps_{uuid.uuid4().hex[:16]}"
    stray = [folder / f"{name}{ending}" for ending in ("_el", "_sl")] + [folder / f"sem.{name}_mutex"]
    whole, new, locked = (folder / f"{name}{letter}" for letter in "xyz")
    kept = [whole, Path(f"{whole}_el"), folder / f"sem.{whole.name}_mutex", Path(f"{new}_el"), Path(f"{locked}_el")]
    try:
        for path in (*stray, *kept):
            path.touch()
            # The file itself is new: another node that ends now would remove an old one.
            if path not in (whole, Path(f"{new}_el")):
                os.utime(path, (time.time() - 100.0,) * 2)
        with Path(f"{locked}_el").open() as owner:
            fcntl.flock(owner, fcntl.LOCK_EX)
            remove_stray()
            assert [path for path in stray if path.exists()] == []
            assert [path for path in kept if not path.exists()] == []
    finally:
        for path in (*stray, *kept):
            path.unlink(missing_ok=True)
