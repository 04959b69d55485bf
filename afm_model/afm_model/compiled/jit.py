"""The project's one way to compile a function with numba, kept on disk (cache.py)."""

import warnings
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import numba
from numba.core import config as _config
from numba.core import sigutils as _sigutils
from numba.core.ccallback import CFunc as _CFunc
from numba.extending import register_jitable

from .cache import KernelCache
from .pieces import INLINED, PIECE, Whole, in_ours

config: Any = _config
sigutils: Any = _sigutils
CFunc: Any = _CFunc
_F = TypeVar("_F", bound=Callable[..., object])

# A record that begins with the fields of another is taken by kernels of that one: it is the same pointer.
warnings.filterwarnings(
    "ignore", ".*has been considered a subtype of", category=numba.core.errors.NumbaExperimentalFeatureWarning
)


def _compiled(function: _F, **options: Any) -> _F:
    if config.DISABLE_JIT:
        return function
    options["error_model"] = "numpy"
    made: Any = numba.njit(function, pipeline_class=Whole, **options)

    @cache
    def piece() -> Any:
        called: Any = numba.njit(function, **PIECE, **options)
        called._compiling_counter = made._compiling_counter  # by which numba sees that a function calls itself
        return called

    # Our compiled code calls a piece; Python, and functions that are not ours, call what is whole.
    template, overload = made.get_call_template, made.get_overload
    made.get_call_template = lambda *kinds: (piece().get_call_template if in_ours() else template)(*kinds)
    made.get_overload = lambda signature: (piece().get_overload if in_ours() else overload)(signature)
    return _kept(made, function)


def _kept(made: Any, function: Callable[..., object]) -> Any:
    """What numba made of a function, kept on disk, and compiled by one process while the others wait."""
    made._cache = cache = KernelCache(function)
    compile_now = made.compile

    def compile_once(*signature: Any) -> Any:
        try:
            return compile_now(*signature)
        finally:
            cache.release()

    made.compile = compile_once
    return made


def kernel(function: _F) -> _F:
    """Compile `function` in nopython mode, with IEEE division (x/0 is inf, no exception).

    Kernels are compiled into their callers (pieces.py): numba returns even a float through memory and tests an error
    code after every call, which costs a step of the plant some percent. What is called from outside is kept on disk.

    `NUMBA_DISABLE_JIT=1` leaves the plain Python function in place, for coverage and for debugging.
    """
    return _compiled(function, forceinline=True)


def routine(function: _F) -> _F:
    """As `kernel`, but called, not compiled into its callers: for what is long and is called from several places."""
    # Left out, numba takes it from the caller that it compiles at the time.
    return _compiled(function, forceinline=False)


def inlined(function: _F) -> _F:
    """A plain Python function that kernels take too: reading parameters calls it and compiles nothing."""
    return register_jitable(error_model="numpy", **INLINED)(function)


def is_compiled(function: object) -> bool:
    """Whether `function` was made by numba, to be compiled; not if `NUMBA_DISABLE_JIT` is set."""
    return isinstance(function, numba.core.dispatcher.Dispatcher)


def plain(function: _F) -> _F:
    """A kernel as the Python function that it was made from: reading parameters compiles nothing."""
    return getattr(function, "py_func", function)


def callback(signature: Any, function: Callable[..., object]) -> Any:
    """Compile `function` as a C function of `signature`, cached next to the kernels."""
    options = {"error_model": "numpy"}
    signature = sigutils.normalize_signature(signature)
    made = _kept(CFunc(function, signature, locals={}, options=options, pipeline_class=Whole), function)
    made.compile()
    return made
