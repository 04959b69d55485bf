"""Write docs/parameters.md from the parameter declarations. `--check`: only tell whether it is current."""

import sys
from pathlib import Path

from afm_controller_node.node import TUNABLE as LAW_TUNABLE
from afm_model import ControllerParameters, SimParameters
from afm_model.parameters import Group, specifications
from afm_recorder_node.parameters import RecorderParameters
from afm_sim_node.node import TUNABLE as SIM_TUNABLE

TARGET = Path(__file__).resolve().parent.parent / "docs" / "parameters.md"
NODES: tuple[tuple[str, type[Group], tuple[str, ...]], ...] = (
    ("afm_sim_node", SimParameters, SIM_TUNABLE),
    ("afm_controller_node", ControllerParameters, LAW_TUNABLE),
    ("afm_recorder_node", RecorderParameters, ()),
)


def page() -> str:
    """The page as text."""
    lines = [
        "# Parameters",
        "",
        "Made by `python tools/make_docs.py` from the declarations in the code; the same text is behind `--help` and",
        "with a full ROS 2 `ros2 param describe`. What is marked * may change while the node runs; the rest is fixed",
        "at start.",
    ]
    for node, model, tunable in NODES:
        lines += ["", f"## {node}", "", "| name | default | unit | allowed | what |", "|---|---|---|---|---|"]
        for spec in specifications(model):
            mark = "*" if any(spec.name == name or spec.name.startswith(name) for name in tunable) else ""
            default = f"`{str(spec.default).lower() if spec.kind is bool else spec.default}`"
            lines.append(f"| `{spec.name}`{mark} | {default} | {spec.unit} | {spec.allowed} | {spec.description} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Write or check the page."""
    text = page()
    if "--check" in sys.argv[1:]:
        if TARGET.exists() and TARGET.read_text() == text:
            return 0
        print("error: docs/parameters.md is not current: run python tools/make_docs.py", file=sys.stderr)
        return 1
    TARGET.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
