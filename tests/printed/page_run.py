"""Runs the pieces of a page in their order, as a reader does: in one folder, one terminal, one Python."""

import contextlib
import io
import re
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .pieces import ROOT, Piece, pieces

NOT_COPIED = {
    ".git",
    ".venv",
    "ros2_ws",
    "out",
    "__pycache__",
    ".mypy_cache",
    ".ruff_cache",
    ".pytest_cache",
    ".hypothesis",
}


@dataclass
class PageRun:
    """A page that has run.

    Parameters
    ----------
    folder : where it has run
    scope : names that its programs have made
    printed : what each piece has printed, by its mark, or its text if it has none
    """

    folder: Path
    scope: dict[str, Any] = field(default_factory=dict)
    printed: dict[str, str] = field(default_factory=dict)

    def assume(self, program: str) -> None:
        """Make the names that the programs of a page take for granted."""
        with contextlib.chdir(self.folder):
            exec(program, self.scope)

    def program(self, piece: Piece) -> None:
        """Run a program after those before it."""
        shown = io.StringIO()
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(shown):
            exec(compile(piece.text, piece.where, "exec"), self.scope)
        self.printed[piece.mark or piece.text] = shown.getvalue()

    def file(self, piece: Piece, name: str) -> None:
        """Write a parameter file under the name that the page gives it."""
        (self.folder / name).write_text(piece.text)


def run_programs(page: str, folder: Path, *marks: str) -> PageRun:
    """Run the programs of a page that have a name, or those of these names; its files are written as NAME.yaml."""
    done = PageRun(folder)
    for piece in pieces(page):
        if piece.mark and (not marks or piece.mark in marks):
            if piece.kind == "file":
                done.file(piece, f"{piece.mark}.yaml")
            elif piece.kind == "program":
                done.program(piece)
    return done


def copy_clone(folder: Path) -> Path:
    """Copy the clone without what was built, which is linked: what a page writes stays in the copy."""
    shutil.copytree(ROOT, folder, ignore=lambda _, names: NOT_COPIED & set(names), symlinks=True)
    for built in (".venv", "ros2_ws"):
        (folder / built).symlink_to(ROOT / built)
    return folder


class Terminal:
    """A terminal in a folder: each command finds folder and variables as the one before has left them.

    A node stays, as in a terminal of its own: until `close`, or until another one of its kind is started.
    """

    NODE = re.compile(r"ros2 run (afm_\w+_node) \1(?! --help)")

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._nodes: dict[str, Any] = {}
        self._state = folder / "terminal"
        self._state.write_text(f"cd {folder}\n")

    def go_home(self) -> None:
        """Go back to the folder, where each block of a page begins."""
        with self._state.open("a") as state:
            state.write(f"cd {self._folder}\n")

    def run(self, command: str, code: int = 0) -> str:
        """Run a command, and return what it prints; a node is started only.

        Raises
        ------
        AssertionError
            If it ends with another code.
        """
        if node := self.NODE.match(command):
            self._start(node[1], command)
            return ""
        # As in a terminal in which nobody has set it: sessions and scans take a domain that is free.
        command = re.sub(r"^(?=ros2 run afm_bringup (session|scan) )", "env -u ROS_DOMAIN_ID ", command)
        kept = f"code=$?\n(export -p; echo cd $PWD) > {self._state}\nexit $code"
        with self._command(f"{command}\n{kept}") as started:
            assert started.wait(timeout=900.0) == code, f"{command}: {started.told}"
            return str(started.text)

    def _command(self, script: str) -> Any:
        from support import Command  # needs ROS, which programs do not

        return Command("bash", "-c", f"set -a\n. {self._state}\n{script}", folder=self._folder)

    def _start(self, kind: str, command: str) -> None:
        if kind in self._nodes:
            self.close()
        node = self._nodes[kind] = self._command(f"exec {command}")
        # A simulator that says so has found what it needs; for what it answers clients wait by themselves.
        if kind == "afm_sim_node":
            node.wait_until(lambda: re.search("running|waiting for a controller", node.text), timeout=600.0)

    def close(self) -> None:
        """End the nodes that still run, as Ctrl-C does.

        Raises
        ------
        AssertionError
            If one has failed.
        """
        nodes, self._nodes = self._nodes, {}
        failed = []
        for name, node in reversed(nodes.items()):
            with node:
                if not node.ended:
                    node.interrupt()
                if node.wait() or "Traceback" in node.text:
                    failed.append(f"{name}: {node.told}")
        assert failed == []
