"""The pieces of a page that somebody may run: commands, programs, parameter files, and texts that are none of them."""

import ast
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
PAGES = ["README.md", "CONTRIBUTING.md", *sorted(f"docs/{each.name}" for each in ROOT.glob("docs/*.md"))]
PROGRAMS = (
    *("make", "ros2", "python", "pip", "rerun", "docker", "jupyter", "dask", "colcon", "sudo", "rqt_plot"),
    *("afm", r"\.", "export", "cd", "cp", "rm", "mkdir", "for"),
)
COMMAND = re.compile(rf"(?:[A-Z_]+=(?:\$\(|\S+ ))|(?:{'|'.join(PROGRAMS)}) ")


@dataclass(frozen=True)
class Piece:
    """A command, a program, a parameter file or a text.

    Parameters
    ----------
    page, line : where it stands
    block : line at which its block begins
    kind : "command", "program", "file" or "text"
    text : what it says
    mark : name in the comment `<!-- name -->` of the line before, or empty
    """

    page: str
    line: int
    block: int
    kind: str
    text: str
    mark: str = ""

    @property
    def where(self) -> str:
        """Page and line, with the beginning of the text."""
        first = self.text.splitlines()[0]
        return f"{self.page}:{self.line}: {first if len(first) < 100 else first[:97] + '...'}"


@cache
def pieces(page: str) -> tuple[Piece, ...]:
    """Return all pieces of a page, in its order."""
    return tuple(piece for block in _blocks(page) for piece in _split(*block))


def _blocks(page: str) -> Iterator[tuple[str, int, str, str, list[str]]]:
    """Page, first line, language, mark and lines of each block, fenced or indented."""
    lines = [*(ROOT / page).read_text().splitlines(), ""]
    at = 0
    while at < len(lines):
        fence = re.match(r"(```+|~~~+)(\S*)", lines[at])
        begin = at
        if fence:
            end = next(k for k in range(at + 1, len(lines)) if lines[k].startswith(fence[1]))
            mark = re.fullmatch(r"<!-- ([\w ]+) -->", lines[at - 1])
            yield page, at + 2, fence[2] or "text", mark[1] if mark else "", lines[at + 1 : end]
            at = end
        elif re.match(r" {4}", lines[at]) and not lines[at - 1].strip():
            while not lines[at].strip() or lines[at].startswith("    "):
                at += 1
                if at == len(lines):
                    break
            yield page, begin + 1, "", "", [line[4:] for line in lines[begin:at]]
            at -= 1
        at += 1


def _split(page: str, first: int, language: str, mark: str, lines: list[str]) -> Iterator[Piece]:
    """Commands are a piece each; what stands between them is another one."""
    if language:
        kind = {"python": "program", "yaml": "file"}.get(language, "text")
        yield Piece(page, first, first, kind, "\n".join(lines) + "\n", mark)
        return
    rest: list[str] = []
    at = 0
    while at < len(lines):
        if not COMMAND.match(lines[at]):
            rest.append(lines[at])
            at += 1
            continue
        yield from _other(page, first, first + at, rest)
        rest, command, begin = [], lines[at], at
        while _goes_on(command):
            at += 1
            command += "\n" + lines[at]
        yield Piece(page, first + begin, first, "command", command)
        at += 1
    yield from _other(page, first, first + at, rest)


def _goes_on(command: str) -> bool:
    """Whether a command needs its next line."""
    try:
        shlex.split(command, comments=True)
    except ValueError:  # an open quote, or a backslash at the end
        return True
    return command.endswith("\\")


def _other(page: str, first: int, end: int, lines: list[str]) -> Iterator[Piece]:
    """What is no command, if it is anything: by what it can be read as."""
    text = "\n".join(lines).strip("\n")
    if not text or all(line.lstrip().startswith("#") for line in lines if line.strip()):
        return
    yield Piece(
        page, end - len(lines), first, "file" if _is_file(text) else "program" if _is_program(text) else "text", text
    )


def _is_file(text: str) -> bool:
    try:
        found = yaml.safe_load(text)
    except yaml.YAMLError:
        return False
    return isinstance(found, dict) and all(isinstance(value, dict) for value in found.values())


def _is_program(text: str) -> bool:
    try:
        ast.parse(text)
    except SyntaxError:
        return False
    return True
