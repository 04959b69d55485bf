"""Claims about the Makefile: .ci/run runs each target, `make help` lists it, and its tool understands its arguments."""

import os
import re
import shlex
import shutil
import subprocess

import pytest
from printed.pieces import ROOT

MAKEFILE = (ROOT / "Makefile").read_text()
TARGETS = re.search(r"^\.PHONY: (.*)$", MAKEFILE, re.MULTILINE)[1].split()
TOOLS = ("scan", "figures", "notebooks", "maps", "laws", "bench", "soak", "torture")
"""Targets that give arguments to a tool."""


@pytest.fixture(autouse=True)
def _alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without what `make test` hands down to a make that it calls."""
    for name in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL"):
        monkeypatch.delenv(name, raising=False)


def planned(target: str, *options: str) -> str:
    """What make would run last for a target."""
    done = subprocess.run(["make", "-n", target, *options], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1].strip()


def called(command: str) -> list[str]:
    """The tool and its arguments."""
    words = shlex.split(command.rpartition("&& ")[2])
    return [word for word in words if not re.match(r"[A-Z]+=", word)]


@pytest.mark.parametrize("target", TOOLS)
def test_tool_of_a_target_understands_what_the_target_gives_it(target: str) -> None:
    if target == "notebooks":
        pytest.importorskip("nbformat", reason="make notebooks installs what it needs, and .ci/run runs it")
    given = [*called(planned(target)), *called(planned(target, "QUICK=1"))]
    program = given[:4] if given[0] == "ros2" else given[:2]
    shown = f"export PYTHONPATH=$PWD/tests:$PYTHONPATH; {shlex.join(program)} --help"
    told = subprocess.run(["bash", "-c", shown], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    options = re.findall(r"--[a-z-]+", told)
    assert [word for word in given if word.startswith("--") and word not in options] == []


def test_arguments_reach_the_tool_and_no_default_of_another_target_does() -> None:
    for target in TOOLS:
        given = called(planned(target, "ARGS=--seed '1 2'"))
        assert given[-2:] == ["--seed", "1 2"]
        assert ("--page" in called(planned(target))) == (target in ("soak", "torture"))


def test_help_lists_every_target_with_what_it_does_as_it_is_written() -> None:
    told = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    listed = re.findall(r"^make ([a-z-]+) +\S", told, re.MULTILINE)
    # Others are steps of these.
    assert set(listed) == set(TARGETS) - {"help", "run-only", "setup", "with-tests"}
    assert "ARGS='--mode tapping'" in told


def test_continuous_integration_runs_every_target() -> None:
    run = (ROOT / ".ci" / "run").read_text()
    lines = re.findall(r"^(?:make|for target in) ([a-z -]+)", run, re.MULTILINE)
    named = {target for line in lines for target in line.split()}
    reached, waiting = set(), set(named & set(TARGETS))
    while waiting:
        target = waiting.pop()
        reached.add(target)
        needed = re.search(rf"^{target}:([a-z -]*)", MAKEFILE, re.MULTILINE)[1].split()
        waiting |= set(needed) - reached
    # `test-long` is its long tests, and more examples than there is time for; `help` and `clean` are run here.
    assert set(TARGETS) - reached == {"test-long", "help", "clean"}
    assert "tools/test.sh -m long" in run


def test_seed_that_is_printed_is_the_one_that_is_used(tmp_path, monkeypatch) -> None:
    # Each look at the clock is a second later.
    clock = tmp_path / "date"
    clock.write_text("#!/bin/sh\necho x >> $0.looks\nwc -l < $0.looks\n")
    clock.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    done = subprocess.run(["make", "-n", "test-long"], cwd=ROOT, capture_output=True, text=True, check=True)
    printed, again, used = re.findall(r"(?:seed is |SEED=|--hypothesis-seed )(\d+)", done.stdout)
    assert printed == again == used


def test_clean_leaves_the_sources_and_removes_what_was_built(tmp_path) -> None:
    shutil.copy(ROOT / "Makefile", tmp_path)
    for name in (".venv", "out", "ros2_ws/build", "ros2_ws/install", "ros2_ws/log", "ros2_ws/src", "docs"):
        (tmp_path / name).mkdir(parents=True)
    subprocess.run(["make", "clean"], cwd=tmp_path, check=True, capture_output=True)
    assert sorted(str(each.relative_to(tmp_path)) for each in tmp_path.rglob("*")) == [
        "Makefile",
        "docs",
        "ros2_ws",
        "ros2_ws/src",
    ]
