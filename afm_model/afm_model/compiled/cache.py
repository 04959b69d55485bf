"""Compiled kernels on disk, each filed under a fingerprint of the sources that it was made from.

numba's own cache checks only the file of the function itself: after an edit in a callee of another file it serves the
old machine code. Here an edit compiles again what depends on it and nothing else, and going back finds what was there
before. Each kernel is a separate file, written whole: processes at the same time do not disturb each other. The others
wait for what one of them compiles.

Kernels of the shipped scenarios, compiled for any processor of the architecture, may stand in the package itself
(tools/make_kernels.py): they are found by the same fingerprints, and save the first run ten seconds.
"""

import fcntl
import hashlib
import os
import pickle
import shutil
import stat
import time
import types
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba.core import caching as _caching
from numba.core import compiler as _compiler
from numba.core.serialize import dumps as _dumps

from .sources import MODE, Sources, has_kernels, write

caching: Any = _caching
compiler: Any = _compiler
dumps: Any = _dumps

UNUSED_DAYS = 30
"""What no process has used for so long is removed."""
LARGEST = 256_000_000
"""Above this the folder is cut down, what was used last stays. [bytes]"""
SHIPPED = Path(__file__).resolve().parents[1] / "kernels"
"""Kernels that came with the package; who could write there could write the package itself."""
ANY_PROCESSOR = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
"""Environment in which numba compiles what every processor of the architecture can run."""
_DAY = 86400.0
_PATIENCE = 180.0
"""What another process compiles is waited for so long [s], in case that process stands still."""


def _folder() -> Path | None:
    root = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(root) if root else Path.home() / ".cache") / "afm_model"
    except RuntimeError:  # no home
        return None


def _is_safe(found: os.stat_result) -> bool:
    """Return whether only this user or root can have written a file, or put files into a folder.

    What is read from it is run, by `pickle` and as machine code.
    """
    return found.st_uid in (0, os.geteuid()) and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _refusal(folder: Path) -> str:
    """Return why nothing is read from a folder, or an empty text if it is safe or does not exist yet."""
    try:
        found = folder.stat()
    except OSError:
        return ""
    if _is_safe(found):
        return ""
    if found.st_uid not in (0, os.geteuid()):
        return f"{folder} belongs to user {found.st_uid}, whose code would be run: it must belong to you or to root"
    return f"other users can write to {folder}, and their code would be run: chmod -R go-w {folder}"


@cache
def _shelf() -> tuple[Path | None, Sources]:
    """Return the folder of all kernels, None if it is not safe, and the fingerprints; the folder is cleaned first."""
    folder = _folder()
    if folder is not None:
        if why := _refusal(folder):
            _complain(why)
            return None, Sources(None)
        clean(folder)
    return folder, Sources(folder)


def clean(folder: Path) -> None:
    """Remove what was not used for UNUSED_DAYS, and the oldest of what is above LARGEST; once a day at most.

    Any number of processes may do so at once, and others use the folder meanwhile.
    """
    mark = folder / "cleaned"
    now = time.time()
    try:
        if mark.exists() and now - mark.stat().st_mtime < _DAY:
            return
        folder.mkdir(mode=MODE, parents=True, exist_ok=True)
        mark.touch()
        kept = sorted(((each.stat().st_mtime, each) for each in folder.iterdir() if each.is_dir()), reverse=True)
    except OSError:
        return
    room = LARGEST
    for used, each in kept:
        room -= _size(each)
        if room < 0 or now - used > UNUSED_DAYS * _DAY:
            shutil.rmtree(each, ignore_errors=True)


def _size(folder: Path) -> int:
    try:
        return sum(file.stat().st_size for file in folder.rglob("*"))
    except OSError:  # another process has removed it
        return 0


@cache
def _use(folder: Path) -> None:
    """Keep a folder from being removed as unused."""
    try:
        if time.time() - folder.stat().st_mtime > _DAY:
            os.utime(folder)
    except OSError:
        pass


@cache
def _complain(why: str) -> None:
    warnings.warn(
        f"compiled kernels cannot be kept ({why}), each process compiles its own: set NUMBA_CACHE_DIR to a folder that "
        "only you can write to",
        RuntimeWarning,
        stacklevel=2,
    )


def _described(code: types.CodeType, docstring: str | None = None) -> Any:
    """Return what distinguishes functions of one name in one file."""
    constants = [
        _described(each) if isinstance(each, types.CodeType) else repr(None if each is docstring else each)
        for each in code.co_consts
    ]
    return code.co_code, code.co_names, code.co_varnames, constants


def _read(path: Path | None, target_context: Any) -> Any:
    if path is None:
        return None
    try:
        with path.open("rb") as file:
            # The file itself and not its name, behind which another file may have been put meanwhile.
            ours = _is_safe(os.fstat(file.fileno())) and _is_safe(path.parent.stat())
            if not (ours or path.is_relative_to(SHIPPED)):
                return None
            return compiler.CompileResult._rebuild(target_context, *pickle.loads(file.read()))
    except Exception:  # not there, or damaged, which may raise anything
        return None


class KernelCache(caching._Cache):  # type: ignore[misc]
    """Machine code of one function, as numba's dispatchers and C functions ask for it.

    Parameters
    ----------
    function : callable
        In Python.
    """

    def __init__(self, function: Callable[..., object]) -> None:
        self._function: Any = function
        spec = self._function.__globals__.get("__spec__")
        self._file = self._function.__code__.co_filename
        self._module = spec.name if spec is not None else Path(self._file).stem
        has_kernels(self._module, self._file)
        self._enabled = True
        self._locks: dict[Path, int] = {}

    @property
    def cache_path(self) -> str | None:
        """Folder of the kernels of this function's file; None where they cannot be kept."""
        folder, module = _shelf()[0], self._name()
        return str(folder / module) if folder is not None and module is not None else None

    def _name(self) -> str | None:
        """Name of that folder; None if it is not known what the file did when it was loaded."""
        try:
            fingerprint, unchanged = _shelf()[1].fingerprint(self._module, self._file)
        except (OSError, SyntaxError):  # typed at a prompt, or made of text
            return None
        return f"{self._module}-{fingerprint[:20]}" if unchanged else None

    def _path(self, folder: Path | None, signature: Any, processor: tuple[str, str, str]) -> Path | None:
        """File of a kernel below a folder; `processor`: architecture, name and features, as numba names them."""
        module = self._name() if self._enabled else None
        cells = [cell.cell_contents for cell in self._function.__closure__ or ()]
        code = _described(self._function.__code__, self._function.__doc__)
        key = f"{signature} {processor} {code}"
        # An argument that is itself a function is known by its address, which says nothing in another process.
        if folder is None or module is None or " at 0x" in key:
            return None
        digest = hashlib.sha256(key.encode() + (dumps(cells) if cells else b"")).hexdigest()
        return folder / module / f"{self._function.__qualname__.replace('<', '').replace('>', '')}-{digest[:20]}"

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """What was compiled for a signature, or None: then it is for this process to compile, until `release`."""
        target_context.refresh()
        processor = target_context.codegen().magic_tuple()
        path = self._path(_shelf()[0], signature, processor)
        compiled = _read(path, target_context)
        if compiled is None:
            shipped = self._path(SHIPPED, signature, (processor[0], *ANY_PROCESSOR.values()))
            compiled = _read(shipped, target_context)
            if compiled is not None or path is None:
                return compiled
            self._lock(path)
            compiled = _read(path, target_context)
        if compiled is not None and path is not None:
            _use(path.parent)
        return compiled

    def _lock(self, path: Path) -> None:
        """Be the one that compiles a kernel, once no other process does."""
        if path in self._locks:  # a kernel that calls itself
            return
        try:
            path.parent.mkdir(mode=MODE, parents=True, exist_ok=True)
            lock = os.open(path.with_name(f"{path.name}.lock"), os.O_RDWR | os.O_CREAT)
        except OSError:  # a folder that cannot be written is told of when the kernel is kept
            return
        self._locks[path] = lock
        begin = time.monotonic()
        while time.monotonic() - begin < _PATIENCE:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return
            except BlockingIOError:
                time.sleep(0.02)
            except OSError:  # a file system without locks
                return

    def release(self) -> None:
        """Let others compile: what was missing is there, or cannot be compiled."""
        while self._locks:
            path, lock = self._locks.popitem()
            with suppress(OSError):
                path.with_name(f"{path.name}.lock").unlink()
            with suppress(OSError):
                fcntl.flock(lock, fcntl.LOCK_UN)  # closing it is not enough if a copy of the process has it
            os.close(lock)

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep what was compiled for a signature; a folder that cannot be written costs a warning."""
        path = self._path(_shelf()[0], signature, data.codegen.magic_tuple())
        made = data._asdict()
        if path is None or made["lifted"] or made["library"].has_dynamic_globals:
            return
        try:
            write(path, dumps(data._reduce()))
        except OSError as error:
            _complain(str(error))

    def enable(self) -> None:
        """Read and write from now on."""
        self._enabled = True

    def disable(self) -> None:
        """Stop reading and writing from now on."""
        self._enabled = False

    def flush(self) -> None:
        """Remove what was kept for the function's file."""
        if (folder := self.cache_path) is not None:
            shutil.rmtree(folder, ignore_errors=True)


def fingerprint(module: str, file: str) -> str:
    """Hash of what a module of a package with kernels does, with all that it imports of such packages, and of numba.

    Raises
    ------
    OSError, SyntaxError
        If a source cannot be read.
    """
    has_kernels(module, file)
    return _shelf()[1].fingerprint(module, file)[0]
