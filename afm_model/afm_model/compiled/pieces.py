"""What compiled code calls, as pieces of what Python calls.

By itself numba optimises each function, makes machine code of it and a way to call it from Python, also of one that is
only ever called from others, and then does the same for each of those with everything in it. Here a function that
compiled code calls is a piece: it is typed and translated once for its arguments, and linked into the whole, which is
what Python calls, or C code by its address. The whole alone is optimised, becomes machine code and is kept on disk.
"""

from typing import Any

from numba.core import codegen as _codegen
from numba.core import compiler as _compiler
from numba.core import cpu as _cpu
from numba.core import environment as _environment

codegen: Any = _codegen
compiler: Any = _compiler
cpu: Any = _cpu
environment: Any = _environment

_depth = 0
"""Of our functions that are being compiled, each for the one before; numba compiles in one thread at a time."""


class _PieceLibrary(codegen.JITCodeLibrary):  # type: ignore[misc]
    """Code of one function, without that of those that it calls."""

    def finalize(self) -> None:
        """Nothing is optimised here."""
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """Return the module with all that the piece calls, for a function that is not ours."""
        whole = _WholeLibrary(self._codegen, self.name)
        whole.add_linking_library(self)
        whole.link()
        return whole._final_module


class _WholeLibrary(codegen.JITCodeLibrary):  # type: ignore[misc]
    """Code of a function with all pieces that it calls."""

    _linking_libraries: list[Any]

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.enable_object_caching()

    def link(self) -> None:
        """Put in all pieces, each once; other libraries are left to numba."""
        found: dict[Any, None] = {}
        for library in self._linking_libraries:
            _collect(library, found)
        pieces = [each for each in found if isinstance(each, _PieceLibrary)]
        for piece in pieces:
            if hasattr(piece, "_reload_init"):
                # Not every numba has it.
                self._reload_init.update(piece._reload_init)
            self._final_module.link_in(piece._final_module, preserve=True)
        # A copy that nothing calls may be left out. Said before all is linked, one would be left out that only a later
        # piece calls.
        for piece in pieces:
            for function in piece.get_defined_functions():
                self.get_function(function.name).linkage = "linkonce_odr"
        self._linking_libraries = [each for each in found if not isinstance(each, _PieceLibrary)]

    def finalize(self) -> None:
        """See numba."""
        self.link()
        super().finalize()

    def _finalize_specific(self) -> None:
        super()._finalize_specific()
        # Where the Python objects are that code uses, such as to print. numba tells machine code of its own only.
        for variable in self._final_module.global_variables:
            found = environment.lookup_environment(variable.name)
            if found is not None:
                self._codegen.set_env(variable.name, found)


def _collect(library: Any, found: dict[Any, None]) -> None:
    """Note a library, and of a piece also what it calls."""
    if library not in found:
        found[library] = None
        if isinstance(library, _PieceLibrary):
            for each in library._linking_libraries:
                _collect(each, found)


def in_ours() -> bool:
    """Whether numba is compiling a function of ours now."""
    return _depth > 0


class _Compiler(compiler.Compiler):  # type: ignore[misc]
    library: Any

    def compile_extra(self, function: Any) -> Any:
        """See numba."""
        global _depth
        self.state.library = self.library(self.state.targetctx.codegen(), function.__qualname__)
        _depth += 1
        try:
            return super().compile_extra(function)
        finally:
            _depth -= 1


class Whole(_Compiler):
    """How numba compiles what is called from outside."""

    library = _WholeLibrary


class Piece(_Compiler):
    """How numba compiles what is called from compiled code."""

    library = _PieceLibrary

    def compile_extra(self, function: Any) -> Any:
        """See numba."""
        self.state.flags.no_compile = True
        made = super().compile_extra(function)
        # By this numba knows a compiled function. It is never called.
        module, name, kept = made.fndesc.lookup_module(), function.__qualname__, (made.library,)
        known_by = cpu._dynfunc.make_function(module, name, name, 0, made.environment, kept)
        made.target_context.insert_user_function(known_by, made.fndesc, [made.library])
        return made._replace(entry_point=known_by)


PIECE: Any = {"pipeline_class": Piece, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of numba for a piece."""
INLINED: Any = {**PIECE, "forceinline": True}
"""The same for one that is compiled into its callers, such as an `overload`."""
