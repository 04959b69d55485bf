"""Finds elementary functions that are not afm_model.core.elementary's in what a run is made of.

Run by `make lint`. The C library's sin, exp, pow ..., numpy's, and what rests on BLAS and LAPACK give other last bits
on other machines. Of numpy stay arrays, sums, products and square roots; scipy stays where nothing is rounded. A power
is one of whole numbers (`2**bits`); others are `square`, `cbrt`, `power`. Sums of floats are `math.fsum`'s, since
`sum` rounds differently from Python 3.12 on.
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ROOMS = (
    *(
        "compiled",
        "core",
        "parts",
        "contact",
        "cantilever",
        "plant",
        "law",
        "sample",
        "program",
        "fault",
        "piezo",
        "onboard",
        "detector",
    ),
    *("parameters", "instrument", "run", "lanes", "microscope"),
)
FOLDERS = (*(ROOT / "afm_model" / "afm_model" / room for room in ROOMS), ROOT / "afm_predictive" / "afm_predictive")
FUNCTIONS = {"sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"}
FUNCTIONS |= {"exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "pow", "cbrt", "hypot", "dist", "erf", "erfc"}
FUNCTIONS |= {"gamma", "lgamma", "arcsin", "arccos", "arctan", "arctan2", "power", "float_power", "logaddexp"}
FUNCTIONS |= {"logspace", "geomspace", "dot", "matmul", "inner", "vdot", "einsum", "polyfit", "interp", "convolve"}
MODULES = {"math", "np", "cmath"}
ATTRIBUTES = {"linalg", "fft", "default_rng"}
EXACT = {"scipy.ndimage": {"grey_dilation"}}
"""Of scipy what only compares and adds."""


def others(source: str) -> Iterator[tuple[int, str]]:
    """Line and name of each in a file, but for lines that say that they are no part of a run."""
    lines = source.splitlines()
    yield from (place for place in _all(source) if "no part of a run" not in lines[place[0] - 1])


def _all(source: str) -> Iterator[tuple[int, str]]:
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Attribute(ast.Name(module), name) if module in MODULES and name in FUNCTIONS:
                yield node.lineno, f"{module}.{name}"
            case ast.Attribute(_, name) if name in ATTRIBUTES:
                yield node.lineno, name
            case ast.BinOp(left, ast.Pow()) if not (isinstance(left, ast.Constant) and isinstance(left.value, int)):
                yield node.lineno, ast.unparse(node)
            case ast.BinOp(_, ast.MatMult()):
                yield node.lineno, ast.unparse(node)
            case ast.ImportFrom(module=str() as module, names=names) if module.partition(".")[0] == "scipy":
                yield from ((node.lineno, each.name) for each in names if each.name not in EXACT.get(module, set()))


def main() -> int:
    """Tell every such place; 1 if there is any."""
    found = 0
    for file in sorted(file for folder in FOLDERS for file in folder.rglob("*.py")):
        for line, name in others(file.read_text()):
            print(f"{file.relative_to(ROOT)}:{line}: {name} gives other bits elsewhere: core/elementary.py")
            found = 1
    return found


if __name__ == "__main__":
    sys.exit(main())
