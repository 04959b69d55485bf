"""What compiled code was made from: a fingerprint of a module and of all that it imports of packages with kernels.

Comments, docstrings and the place of a line do not count. For the some 140 files of the loop this takes 13 ms: what
a file says without its docstrings is looked up by the hash of its bytes, and found by `ast` only when that is new.
"""

import ast
import hashlib
import json
import os
import sys
import time
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import numba

_STARTED = time.time()
_ROOTS: dict[str, Path] = {}
"""Folder above each package (or module at the top) that has kernels."""
_KEPT_SOURCES = 2000
MODE = 0o755
"""Of a folder that is made here: only its owner writes to it, whatever the umask says."""
_Import = tuple[int, str, list[str]]


def has_kernels(module: str, file: str) -> None:
    """Make known that `module`, in this file, has kernels: imports from its package are followed."""
    path = Path(file)
    above = module.count(".") + (path.name == "__init__.py")
    _ROOTS.setdefault(module.partition(".")[0], path.parents[above])


class _Bare(ast.NodeTransformer):
    """Takes out what has no part in what a module does: docstrings, imports for types."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        return None if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str) else node

    def visit_If(self, node: ast.If) -> ast.AST | None:
        if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            return None
        return self.generic_visit(node)


def _parsed(text: bytes) -> tuple[str, list[_Import]]:
    """Hash of a source without comments and docstrings, and what it imports."""
    tree = _Bare().visit(ast.parse(text))
    imports: list[_Import] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            imports.append((node.level, node.module or "", [name.name for name in node.names]))
        elif isinstance(node, ast.Import):
            imports.extend((0, name.name, []) for name in node.names)
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest(), imports


@cache
def _listed(folder: Path) -> frozenset[str]:
    try:
        return frozenset(os.listdir(folder))
    except OSError:
        return frozenset()


@cache
def _file(module: str) -> Path | None:
    """The source of a module of a package with kernels."""
    *above, name = module.split(".")
    root = _ROOTS.get(module.partition(".")[0])
    if root is None:
        return None
    folder = root.joinpath(*above)
    if f"{name}.py" in _listed(folder):
        return folder / f"{name}.py"
    return folder / name / "__init__.py" if "__init__.py" in _listed(folder / name) else None


def _imported(module: str, package: bool, imports: list[_Import]) -> set[str]:
    """Modules with a source that a module imports, by name."""
    found = set()
    for level, base, names in imports:
        if level:
            parts = module.split(".")
            parts = parts[: len(parts) + package - level]
            base = ".".join([*parts, base] if base else parts)
        if base.partition(".")[0] not in _ROOTS:
            continue
        for name in names or [""]:
            inner = f"{base}.{name}"
            found.add(inner if name and _file(inner) else base)
    return {name for name in found if _file(name)}


class Sources:
    """Fingerprints of modules, each file read once in a process.

    Parameters
    ----------
    memory : Path, optional
        Folder in which what was found by `ast` is kept for the next process; without it nothing is kept.
    """

    def __init__(self, memory: Path | None) -> None:
        self._memory = None if memory is None else memory / "sources.json"
        self._parsed: dict[str, Any] = {}
        self._read: dict[str, tuple[str, float, set[str]]] = {}
        self._known: dict[str, tuple[str, bool]] = {}
        if self._memory is not None:
            try:
                self._parsed = json.loads(self._memory.read_bytes())
            except (OSError, ValueError):
                pass  # none yet, or damaged: found anew
        self._of_disk = len(self._parsed)

    def fingerprint(self, module: str, file: str) -> tuple[str, bool]:
        """Hash of all that `module` does, and whether none of it was edited since this process began.

        Parameters
        ----------
        module, file : str
            Its name, and where it stands.

        Raises
        ------
        OSError, SyntaxError
            If a source cannot be read or is not Python.
        """
        if module not in self._known:
            todo, seen = [(module, Path(file))], {module}
            digest = [f"{numba.__version__} {llvmlite.__version__} {sys.implementation.cache_tag}"]
            newest = 0.0
            while todo:
                name, path = todo.pop()
                said, changed, imports = self._source(name, path)
                digest.append(f"{name} {said}")
                newest = max(newest, changed)
                new = imports - seen
                seen |= new
                todo.extend((each, found) for each in new if (found := _file(each)) is not None)
            text = "\n".join([digest[0], *sorted(digest[1:])])
            # What stands on disk since then is not what this process has loaded.
            self._known[module] = hashlib.sha256(text.encode()).hexdigest(), newest < _STARTED
            self._remember()
        return self._known[module]

    def _source(self, module: str, path: Path) -> tuple[str, float, set[str]]:
        if module not in self._read:
            with path.open("rb") as file:
                text = file.read()
                changed = os.fstat(file.fileno()).st_mtime
            key = hashlib.sha256(text).hexdigest()
            if key not in self._parsed:
                self._parsed[key] = _parsed(text)
            said, imports = self._parsed[key]
            self._read[module] = said, changed, _imported(module, path.name == "__init__.py", imports)
        return self._read[module]

    def _remember(self) -> None:
        if self._memory is None or len(self._parsed) == self._of_disk:
            return
        self._of_disk = len(self._parsed)
        newest = dict(list(self._parsed.items())[-_KEPT_SOURCES:])
        try:
            write(self._memory, json.dumps(newest).encode())
        except OSError:
            pass  # found anew by the next process


def write(path: Path, data: bytes) -> None:
    """Write a file so that another process sees it whole or not at all."""
    path.parent.mkdir(mode=MODE, parents=True, exist_ok=True)
    own = path.with_name(f"{path.name}.{os.getpid()}.{time.monotonic_ns()}")
    try:
        own.write_bytes(data)
        own.chmod(own.stat().st_mode & ~0o022)  # only what its owner alone can write is read
        own.replace(path)
    except OSError:
        own.unlink(missing_ok=True)
        raise
