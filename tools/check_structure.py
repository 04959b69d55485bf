"""Finds circles of imports between the modules of the packages, and names of classes that stand twice.

Run by `make lint`. An import counts wherever it stands: in a function, and for types only, too. A name that begins with
an underscore belongs to its file and does not count; every part of the instrument has the records OF_A_PART of its own.
"""

import ast
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OF_A_PART = {"Constants", "State", "Ledger"}


def modules(root: Path) -> dict[str, tuple[Path, ast.Module]]:
    """Return file and syntax of each module of the packages `afm_*/afm_*` in a folder, by its full name."""
    found = {}
    for package in sorted(root.glob("afm_*/afm_*")):
        for file in sorted(package.rglob("*.py")) if (package / "__init__.py").exists() else ():
            parts = file.relative_to(package.parent).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file, ast.parse(file.read_text())
    return found


def imports(known: dict[str, tuple[Path, ast.Module]]) -> dict[str, set[str]]:
    """Return the modules among the known ones that each of them imports."""
    found: dict[str, set[str]] = {}
    for name, (file, tree) in known.items():
        named = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                named |= {each.name for each in node.names}
            elif isinstance(node, ast.ImportFrom):
                parts = name.split(".")
                above = parts[: len(parts) - node.level + (file.name == "__init__.py")] if node.level else []
                base = ".".join([*above, *([node.module] if node.module else [])])
                named |= {inner if (inner := f"{base}.{each.name}") in known else base for each in node.names}
        found[name] = (named & set(known)) - {name}
    return found


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Return each group of modules that reach one another: Tarjan's strongly connected components."""
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    waiting: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        number[name] = low[name] = len(number)
        waiting.append(name)
        for other in sorted(graph[name]):
            if other not in number:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in waiting:
                low[name] = min(low[name], number[other])
        if low[name] == number[name]:
            at = waiting.index(name)
            group, waiting[at:] = waiting[at:], []
            if len(group) > 1:
                found.append(sorted(group))

    for name in sorted(graph):
        if name not in number:
            visit(name)
    return found


def twice(known: dict[str, tuple[Path, ast.Module]]) -> dict[str, list[str]]:
    """Return the modules of each class name that stands more than once."""
    where: dict[str, list[str]] = defaultdict(list)
    for name, (_, tree) in known.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not (node.name.startswith("_") or node.name in OF_A_PART):
                where[node.name].append(name)
    return {name: places for name, places in sorted(where.items()) if len(places) > 1}


def main() -> int:
    """Print what was found; 1 if there is anything."""
    known = modules(ROOT)
    found = [f"these modules import one another: {', '.join(group)}" for group in circles(imports(known))]
    found += [f"the class name {name} stands twice: {', '.join(places)}" for name, places in twice(known).items()]
    print("\n".join(found), end="\n" if found else "")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
