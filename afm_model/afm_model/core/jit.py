"""The project's one way to compile a function with numba.

numba's on-disk cache checks only the file of the function itself: after an edit in a compiled callee
of another file it silently serves the old machine code. Here the cache lives in a folder named after
the sources of the whole package, so any edit starts a fresh cache.
"""

import hashlib
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import config as _config

config: Any = _config
_F = TypeVar("_F", bound=Callable[..., object])
_PACKAGE = Path(__file__).resolve().parent.parent


def _fingerprint() -> str:
    """The same for the same sources of this package under the same numba."""
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(_PACKAGE.rglob("*.py")):
        digest.update(source.relative_to(_PACKAGE).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


FINGERPRINT = _fingerprint()


def _cache_directory() -> str:
    """Folder of the compiled kernels for exactly these sources."""
    root = os.environ.get("NUMBA_CACHE_DIR")
    if root is None:
        cache_home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        root = str(Path(cache_home) / "afm_model")
    return str(Path(root) / FINGERPRINT)


_CACHE_DIRECTORY = _cache_directory()
_LOCK = threading.RLock()


@contextmanager
def _cache_here() -> Iterator[None]:
    """The cache folder is looked up while a decorator runs: set it for that moment only, so that other users of numba
    in the same process keep their own setting.
    """
    with _LOCK:
        previous = config.CACHE_DIR
        config.CACHE_DIR = _CACHE_DIRECTORY
        try:
            yield
        finally:
            config.CACHE_DIR = previous


def kernel(function: _F) -> _F:
    """Compile `function` in nopython mode, cached on disk, with IEEE division (x/0 is inf, no exception).

    Kernels are compiled into their callers: numba returns even a float through memory and tests an error code after
    every call, which costs a step of the plant some percent.

    `NUMBA_DISABLE_JIT=1` leaves the plain Python function in place, for coverage and for debugging.
    """
    if config.DISABLE_JIT:
        return function
    with _cache_here():
        return numba.njit(function, cache=True, error_model="numpy", forceinline=True)


def routine(function: _F) -> _F:
    """As `kernel`, but called, not compiled into its callers: for what is long and is called from several places."""
    if config.DISABLE_JIT:
        return function
    with _cache_here():
        return numba.njit(function, cache=True, error_model="numpy")


def is_compiled(function: object) -> bool:
    """Whether `function` was made by numba, to be compiled; not if `NUMBA_DISABLE_JIT` is set."""
    return isinstance(function, numba.core.dispatcher.Dispatcher)


def plain(function: _F) -> _F:
    """A kernel as the Python function that it was made from: reading parameters compiles nothing."""
    return getattr(function, "py_func", function)


def callback(signature: Any, function: Callable[..., object]) -> Any:
    """Compile `function` as a C function of `signature`, cached beside the kernels."""
    with _cache_here():
        return numba.cfunc(signature, cache=True, error_model="numpy")(function)
