"""Write what the documentation takes from the code: docs/parameters.md, and parts of other pages between their marks.

`--check`: only tell whether all is current.
"""

import ast
import re
import sys
from collections.abc import Iterable
from pathlib import Path

from afm_bringup.exam.rules import RULES
from afm_controller_node.node import TUNABLE as LAW_TUNABLE
from afm_model.core import registry
from afm_model.core.ranges import LARGEST_INTEGER, RANGES, WIDEST
from afm_model.core.schema import Specification
from afm_model.fault import KINDS
from afm_model.fault.schedule_entry import DRIVES, SENSORS
from afm_model.parameters import Group, SetupSection, specifications
from afm_model.run import TRANSITIONS, Cause, RunState
from afm_nanonis.table import DONE, KEPT, LOCK_INS, MEASURING, MOTION, SETTINGS
from afm_node_common.process import ControllerNodeParameters, SimNodeParameters
from afm_recorder_node.parameters import RecorderParameters
from afm_sim_node.declared import TUNABLE as SIM_TUNABLE

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
NODES: tuple[tuple[str, type[Group], tuple[str, ...]], ...] = (
    ("afm_sim_node", SimNodeParameters, SIM_TUNABLE),
    ("afm_controller_node", ControllerNodeParameters, LAW_TUNABLE),
    ("afm_recorder_node", RecorderParameters, ()),
    ("All nodes: section `/**` of a scenario, what microscope it is (microscope.md)", SetupSection, ()),
)
LAW = "controllers/pd_law.py"
AXIS = re.compile(r"\b[xyz]\b")


def allowed(spec: Specification) -> str:
    """What values are allowed, in fewer words where the bounds are those of the unit."""
    if spec.kind not in (float, int) or spec.choices or spec.family:
        return spec.allowed.partition(", or module:")[0]
    least, most = RANGES.get(spec.unit, WIDEST) if spec.kind is float else (1, LARGEST_INTEGER)
    low, high = spec.lower, spec.upper
    text = f"{'>' if spec.lower_open else '>='} {low:g}, {'<' if spec.upper_open else '<='} {high:g}"
    if high == most and not (spec.lower_open or spec.upper_open):
        text = {least: "> 0", 0.0: ">= 0", -most: "any"}.get(low, f">= {low:g}")
    return text if spec.kind is float else f"whole, {text}"


def grouped(found: Iterable[Specification]) -> list[list[Specification]]:
    """Parameters one by one; those of x, y and z together where nothing but axis and default differs."""
    groups: list[list[Specification]] = []
    for spec in found:
        group = groups[-1] if groups else []
        if (
            0 < len(group) < 3
            and group[0].name.endswith("_x")
            and spec.name == f"{group[0].name[:-1]}{'xyz'[len(group)]}"
            and (spec.unit, allowed(spec)) == (group[0].unit, allowed(group[0]))
            and AXIS.sub("", spec.description) == AXIS.sub("", group[0].description)
        ):
            group.append(spec)
        else:
            groups.append([spec])
    return groups


def parameters() -> str:
    """The page of the parameters."""
    lines = [
        "# Parameters",
        "",
        "Made by `python tools/make_docs.py` from the declarations in the code; the same text is behind `--help` and",
        "with a full ROS 2 `ros2 param describe`. What is marked * may change while the node runs; the rest is fixed",
        "at start. Every number is finite. A `kind` may also be `module:NAME`, a [part of your own](extending.md).",
        "",
        "A bound that is not given is that of the unit. A number other than 0 has at least the least size:",
        "",
        "| unit | least size | largest |",
        "|---|---|---|",
        *(f"| {unit} | {least:g} | {most:g} |" for unit, (least, most) in RANGES.items()),
    ]
    written = dict[str, str]()
    for node, model, tunable in NODES:
        lines += ["", f"## {node}", *_table(specifications(model), tunable, written)]
    lines += ["", "## Kinds", "", "What a kind needs besides what stands above."]
    known = {spec.name: spec for _, model, _ in NODES[:2] for spec in specifications(model)}
    for name, family in ((name, spec.family) for name, spec in known.items() if spec.family):
        group = name.removesuffix("kind")
        for kind in registry.names(family):
            of_kind = specifications(registry.find(family, kind).parameters, group)
            if own := [spec for spec in of_kind if spec.name not in known]:
                tunable = LAW_TUNABLE if family == "law" else ()
                lines += ["", f"### {name} = {kind}", *_table(own, tunable, written)]
    return "\n".join(lines) + "\n"


def _table(specs: Iterable[Specification], tunable: tuple[str, ...], written: dict[str, str]) -> list[str]:
    """Lines of a table of parameters; those that have been `written` before, with the same row, behind it."""
    rows, same = list[str](), list[str]()
    for group in grouped(specs):
        first, axes = group[0], ", ".join("xyz"[: len(group)])
        mark = "*" if any(first.name == name or first.name.startswith(name) for name in tunable) else ""
        name = ", ".join(f"`{spec.name}`" for spec in group)
        values = dict.fromkeys(str(spec.default).lower() if spec.kind is bool else spec.default for spec in group)
        default = ", ".join(f"`{value}`" for value in values)
        what = first.description if len(group) == 1 else AXIS.sub(axes, first.description)
        row = f" | {default} | {first.unit} | {allowed(first)} | {what} |"
        if written.get(name) == row:
            same.append(f"{name}{mark}")
        else:
            rows.append(f"| {name}{mark}{row}")
        written.setdefault(name, row)
    lines = ["", "| name | default | unit | allowed | what |", "|---|---|---|---|---|", *rows] if rows else []
    return [*lines, "", f"As above: {', '.join(same)}."] if same else lines


def kinds() -> str:
    """Every kind of fault, and every signal."""
    units = ", ".join(f"`{name}` [{unit}]" for name, unit in (SENSORS | DRIVES).items())
    lines = [
        f"Signals of sensors and of the drive: {units}.",
        "",
        "| kind | signal | what goes wrong | size |",
        "|---|---|---|---|",
    ]
    for name, kind in KINDS.items():
        targets = ", ".join(f"`{each}`" for each in kind.targets if each != "none")
        if set(SENSORS) < set(kind.targets):
            targets = "any of a sensor or the drive"
        unit = "" if kind.unit in ("", "1") else f" [{kind.unit.replace('{}', 'unit of the signal')}]"
        lines.append(f"| `{name}` | {targets} | {kind.what} | {kind.size}{unit} |")
    return "\n".join(lines)


def rules() -> str:
    """Every rule that check_controller tests."""
    lines = ["| rule | a controller |", "|---|---|", *(f"| {rule.name} | {rule.what} |" for rule in RULES)]
    return "\n".join(lines)


def rooms() -> str:
    """The imports between the rooms of afm_model as a diagram, without the arrows that a longer way implies."""
    package = ROOT / "afm_model" / "afm_model"
    reached: dict[str, set[str]] = {path.name: set() for path in package.iterdir() if (path / "__init__.py").exists()}
    for path in package.rglob("*.py"):
        source, *inner = path.relative_to(package).parts
        for node in ast.walk(ast.parse(path.read_text())):
            # Within the package only relative imports are used; these lead out of the room.
            if isinstance(node, ast.ImportFrom) and node.level == len(inner) + 1 and source in reached:
                names = [node.module.split(".")[0]] if node.module else [name.name for name in node.names]
                reached[source] |= set(names) & set(reached)
    direct = {source: set(targets) for source, targets in reached.items()}
    for _ in reached:
        for targets in reached.values():
            targets.update(*(reached[each] for each in targets))
    arrows = [
        f"  {source} --> {target}"
        for source, targets in sorted(direct.items())
        for target in sorted(targets - set().union(*(reached[each] for each in targets)))
    ]
    return "\n".join(["```mermaid", "flowchart TD", *arrows, "```"])


def transitions() -> str:
    """Every change of state there is, as a table."""
    lines = ["| cause | from | to |", "|---|---|---|"]
    for cause in Cause:
        targets = {target for (_, each), target in TRANSITIONS.items() if each == cause}
        for target in sorted(targets):
            states = [a.name for (a, each), b in TRANSITIONS.items() if (each, b) == (cause, target)]
            origin = "every state" if len(states) == len(RunState) else ", ".join(f"`{name}`" for name in states)
            lines.append(f"| {cause.value} | {origin} | `{target.name}` |")
    return "\n".join(lines)


def commands() -> str:
    """Every command of the Nanonis protocol, Set and Get of a setting together: what those do that do something."""
    lines = ["| command | what |", "|---|---|"]
    others: dict[str, dict[str, list[str]]] = {KEPT: {}, DONE: {}}
    for row in "".join((MEASURING, MOTION, SETTINGS, LOCK_INS)).replace("\n\n", "\n").strip().splitlines():
        name, _, _, how, what = (cell.strip() for cell in row.split("|"))
        module, _, command = name.partition(".")
        if (kind := how.split()[0]) in others:
            others[kind].setdefault(module, []).append(command.removesuffix("Set/Get"))
        else:
            lines.append(f"| {name} | {what} |")
    for kind, title in ((KEPT, "Stored and given back (Set and Get)"), (DONE, "Answered, without an effect")):
        lines += ["", f"{title}:", "", *(f"- {module}: {', '.join(each)}" for module, each in others[kind].items())]
    return "\n".join(lines)


def between_marks(page: str, mark: str, text: str) -> str:
    """`page` with `text` between `<!-- mark -->` and the next `<!-- end -->`."""
    before, begin, rest = page.partition(f"<!-- {mark} -->\n")
    _, end, after = rest.partition("<!-- end -->")
    if not (begin and end):
        raise ValueError(f"there is no place <!-- {mark} --> ... <!-- end --> in the page")
    return before + begin + text + "\n" + end + after


def pages() -> dict[Path, str]:
    """Every page with what it takes from the code."""
    patches = f"```python\n{(ROOT / 'examples' / 'parts' / 'patches.py').read_text().rstrip()}\n```"
    law = (ROOT / "examples" / LAW).read_text().rstrip()
    controllers = between_marks((DOCS / "controllers.md").read_text(), "pd_law", f"```python\n{law}\n```")
    return {
        DOCS / "controllers.md": between_marks(controllers, "rules", rules()),
        DOCS / "nanonis.md": between_marks((DOCS / "nanonis.md").read_text(), "commands", commands()),
        DOCS / "faults.md": between_marks((DOCS / "faults.md").read_text(), "kinds", kinds()),
        DOCS / "safe_states.md": between_marks((DOCS / "safe_states.md").read_text(), "transitions", transitions()),
        DOCS / "parameters.md": parameters(),
        DOCS / "extending.md": between_marks((DOCS / "extending.md").read_text(), "patches", patches),
        DOCS / "architecture.md": between_marks((DOCS / "architecture.md").read_text(), "rooms", rooms()),
    }


def main() -> int:
    """Write or check the pages."""
    stale = [path for path, text in pages().items() if not path.exists() or path.read_text() != text]
    if "--check" in sys.argv[1:]:
        for path in stale:
            print(f"error: {path.relative_to(ROOT)} is not current: run python tools/make_docs.py", file=sys.stderr)
        return 1 if stale else 0
    for path, text in pages().items():
        path.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
