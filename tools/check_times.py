"""Finds tests that assert that something takes less than some seconds: a busy machine fails them without a fault.

Run by `make lint`. A time may be less than another one of the same run (`took < 0.5 * waited`), not less than a number
or about one, nor may a moment be before another with a number added (`begin + 20.0`). That something took at least as
long as it has waited holds on any machine. What a clock returns is followed through names, sums, calls and lists of one
file, and so are the wall times that scores and traces tell. A wait that gives up raises TimeoutError: that is no
assertion.
"""

import ast
import sys
from collections.abc import Iterator
from enum import IntEnum
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CLOCKS = {"monotonic", "perf_counter", "process_time", "thread_time", "time"}
CLOCKS |= {f"{name}_ns" for name in CLOCKS}
TOLD = {"wall", "elapsed", "lateness", "round_trip", "round_trips", "command_age"}
"""Fields of scores and traces that are wall times; not in tests/model, where the clock is set by hand."""
NO_TIMES = {"len", "isfinite", "isnan", "flatnonzero"}
"""Functions of times that return none."""


class Kind(IntEnum):
    """What a value is made of; of several parts the greatest counts."""

    OTHER = 0
    NUMBER = 1
    TIME = 2
    DEADLINE = 3  # a time and a number, added


class Times(ast.NodeVisitor):
    """Follows times through one file.

    Parameters
    ----------
    told : set of str
        Names of fields that hold wall times.
    """

    def __init__(self, told: set[str]) -> None:
        self._told = told
        self._kinds: dict[str, Kind] = {}
        self.changed = True
        """Whether anything new was learned since this was last set to False."""

    def kind(self, node: ast.AST | None) -> Kind:
        """What the value of an expression is made of."""
        match node:
            case ast.Constant(value=int() | float() as value) if value:
                return Kind.NUMBER
            case ast.Name() | ast.Attribute():
                name = ast.unparse(node)
                if isinstance(node, ast.Attribute) and node.attr in self._told:
                    return Kind.TIME
                return Kind.NUMBER if name.isupper() else self._kinds.get(name, Kind.OTHER)
            case ast.BinOp(left, ast.Add() | ast.Sub(), right):
                kinds = {self.kind(left), self.kind(right)}
                return Kind.DEADLINE if kinds == {Kind.TIME, Kind.NUMBER} else max(kinds)
            case ast.BinOp(left, _, right):
                kinds = {self.kind(left), self.kind(right)}
                # A time over a time is a ratio, and so is what is compared with it.
                ratio = isinstance(node.op, ast.Div) and kinds <= {Kind.TIME, Kind.DEADLINE}
                return Kind.OTHER if ratio else max(kinds)
            case ast.Call(ast.Attribute(ast.Name("time"), name) | ast.Name(name)) if name in CLOCKS:
                return Kind.TIME
            case ast.Call(function, arguments, keywords):
                if ast.unparse(function).rpartition(".")[2] in NO_TIMES:
                    return Kind.OTHER
                method = function.value if isinstance(function, ast.Attribute) else None
                return max(map(self.kind, [method, *arguments, *(word.value for word in keywords)]))
            case ast.ListComp(elt) | ast.SetComp(elt) | ast.GeneratorExp(elt):
                return self.kind(elt)
            case ast.UnaryOp(operand=value) | ast.Subscript(value) | ast.Starred(value):
                return self.kind(value)
            case ast.List(elts) | ast.Tuple(elts) | ast.BoolOp(values=elts):
                return max(map(self.kind, elts), default=Kind.OTHER)
            case ast.IfExp(_, body, other):
                return max(self.kind(body), self.kind(other))
        return Kind.OTHER

    def _learn(self, target: ast.AST, kind: Kind) -> None:
        while isinstance(target, ast.Subscript | ast.Starred):
            target = target.value
        for each in target.elts if isinstance(target, ast.Tuple | ast.List) else ():
            self._learn(each, kind)
        if isinstance(target, ast.Name | ast.Attribute) and kind >= Kind.TIME:
            name = ast.unparse(target)
            if kind > self._kinds.get(name, Kind.OTHER):
                self._kinds[name] = kind
                self.changed = True

    def visit(self, node: ast.AST) -> None:
        """Learn from a statement and all that is in it."""
        match node:
            case ast.Assign(targets, ast.Tuple(values)) if all(isinstance(one, ast.Tuple) for one in targets):
                for target in targets:
                    for each, value in zip(target.elts, values, strict=False):  # type: ignore[attr-defined]
                        self._learn(each, self.kind(value))
            case ast.Assign(targets, value):
                for target in targets:
                    self._learn(target, self.kind(value))
            case ast.AnnAssign(target, _, value) | ast.AugAssign(target, _, value) | ast.NamedExpr(target, value):
                self._learn(target, self.kind(value))
            case ast.For(target, values) | ast.comprehension(target, values):
                self._learn(target, self.kind(values))
            case ast.Call(ast.Attribute(target, "append" | "add" | "extend"), arguments):
                self._learn(target, max(map(self.kind, arguments), default=Kind.OTHER))
        self.generic_visit(node)


def asserted_times(source: str, told: set[str] = TOLD) -> Iterator[int]:
    """Lines of a file with an assertion that something takes less than a number of seconds."""
    tree = ast.parse(source)
    times = Times(told)
    while times.changed:
        times.changed = False
        times.visit(tree)
    for statement in ast.walk(tree):
        if isinstance(statement, ast.Assert):
            compared = (node for node in ast.walk(statement.test) if isinstance(node, ast.Compare))
            if any(_bounds(times, node) for node in compared):
                yield statement.lineno


def _bounds(times: Times, compared: ast.Compare) -> bool:
    """Whether a comparison says that a time is less than, or about, a number."""
    sides = [compared.left, *compared.comparators]
    for left, operator, right in zip(sides[:-1], compared.ops, sides[1:], strict=True):
        match operator:
            case ast.Lt() | ast.LtE():
                pairs = [(left, right)]
            case ast.Gt() | ast.GtE():
                pairs = [(right, left)]
            case ast.Eq() if any("approx(" in ast.unparse(side) for side in (left, right)):
                pairs = [(left, right), (right, left)]
            case _:
                continue
        for less, more in pairs:
            if times.kind(less) >= Kind.TIME and times.kind(more) in (Kind.NUMBER, Kind.DEADLINE):
                return True
    return False


def main() -> int:
    """Tell every such line; 1 if there is any."""
    found = []
    for file in sorted((ROOT / "tests").rglob("*.py")):
        name = file.relative_to(ROOT)
        told = set() if name.parts[1] == "model" else TOLD
        found += [f"{name}:{line}" for line in asserted_times(file.read_text(), told)]
    for place in found:
        print(f"{place}: no test asserts how many seconds something takes at most")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
