"""Runs a notebook as Jupyter does, cell after cell in one namespace, without Jupyter."""

import ast
import contextlib
import io
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.axis import Axis


@dataclass
class Shown:
    """What a cell shows."""

    text: str = ""
    html: str = ""  # of its last expression, if that is a table
    figures: int = 0


@dataclass
class Ran:
    """A notebook that has run."""

    folder: Path  # in which it has run
    namespace: dict[str, Any]
    shown: list[Shown]  # of each code cell, now
    stored: list[Shown]  # of each code cell, in the file
    unlabelled: list[str] = field(default_factory=list)  # axes that do not say what they show

    def __getitem__(self, name: str) -> Any:
        """A value of the namespace."""
        return self.namespace[name]


def run(path: Path) -> Ran:
    """Run the code cells of a notebook in its folder.

    Raises
    ------
    Exception
        What a cell raises.
    """
    cells = [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code"]
    ran = Ran(path.parent, {"__name__": path.stem}, [], [_stored(cell) for cell in cells])
    plt.close("all")
    with contextlib.chdir(path.parent), plt.rc_context(), plt.ioff():
        plt.switch_backend("Agg")
        for number, cell in enumerate(cells):
            ran.shown.append(_execute("".join(cell["source"]), f"{path.name}, cell {number + 1}", ran))
    return ran


def _execute(source: str, name: str, ran: Ran) -> Shown:
    tree = ast.parse(source, name)
    last = ast.Expression(tree.body.pop().value) if isinstance(tree.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, name, "exec"), ran.namespace)
        value = None if last is None else eval(compile(last, name, "eval"), ran.namespace)
    html = getattr(value, "_repr_html_", lambda: "")()
    figures = [plt.figure(number) for number in plt.get_fignums()]
    for figure in figures:
        figure.canvas.draw()
        ran.unlabelled += [f"{name}: {axes}" for axes in figure.axes if not _says_what_it_shows(axes)]
    plt.close("all")
    return Shown(printed.getvalue(), html, len(figures))


def _says_what_it_shows(axes: Axes) -> bool:
    def said(axis: Axis, side: str) -> bool:
        bare = not axis.get_visible() or not len(axis.get_ticklocs()) or not axis.get_tick_params().get(side, True)
        return bare or bool(axis.label.get_text())

    return said(axes.xaxis, "labelbottom") and said(axes.yaxis, "labelleft")


def _stored(cell: dict[str, Any]) -> Shown:
    shown = Shown()
    for output in cell["outputs"]:
        kind = output["output_type"]
        if kind == "stream" and output["name"] == "stdout":
            shown.text += "".join(output["text"])
        elif kind == "execute_result":
            shown.html += "".join(output["data"].get("text/html", []))
        elif kind == "display_data" and "image/png" in output["data"]:
            shown.figures += 1
        else:
            raise AssertionError(f"a cell has stored {kind} {output}")
    return shown
