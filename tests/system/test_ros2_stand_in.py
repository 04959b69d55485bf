"""The stand-in for `ros2` runs what the README tells, in an environment that has no ros2cli."""

import os
import subprocess
from pathlib import Path

import pytest
from support import ROOT, executable

PACKAGES = {
    "afm_sim_node": {"afm_sim_node"},
    "afm_controller_node": {"afm_controller_node"},
    "afm_recorder_node": {"afm_recorder_node", "repair"},
    "afm_bringup": {"session"},
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


def test_what_it_does_not_know_is_answered_with_what_it_does() -> None:
    for arguments in ((), ("topic", "list"), ("run", "afm_sim_node")):
        end = ros2(*arguments)
        assert end.returncode == 1
        assert "ros2 run PACKAGE EXECUTABLE" in end.stderr
