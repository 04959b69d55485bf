"""Draw the figures of paper.md, tuning.md (docs) and README.md, write the tables, from scenario files: no hand work.

python tools/make_figures.py            # all of it: docs/figures and docs/paper.md
python tools/make_figures.py figure_4   # one figure
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
from figures import (
    both_loops,
    control_forces,
    error_ball,
    figure_2,
    figure_4,
    figure_5,
    figure_6,
    numbers,
    page,
    style,
    tuning,
)
from figures.runs import ROOT, Runs
from matplotlib.figure import Figure

FIGURES: dict[str, Callable[[Runs], Figure]] = {
    "figure_2": figure_2.draw,
    "figure_4": figure_4.draw,
    "figure_6": figure_6.draw,
    "figure_5_motion": figure_5.draw_motion,
    "figure_5_forces": figure_5.draw_forces,
    "control_forces": control_forces.draw,
    "error_ball": error_ball.draw,
    "both_loops": both_loops.draw,
    "tuning": tuning.draw,
}
TABLES: dict[str, Callable[[Runs], list[str]]] = {"open_loop": numbers.open_loop, "closed_loop": numbers.closed_loop}
PAGE = ROOT / "docs" / "paper.md"


def main() -> int:
    """Draw what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"figures to draw: {', '.join(FIGURES)}; default: all")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "figures", help="folder to write to")
    parser.add_argument("--duration", type=float, help="cut every run to so many seconds, for a quick look")
    parser.add_argument("--dpi", type=float, default=style.DPI, help="resolution of the PNG")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.names if name not in FIGURES]
    if unknown:
        parser.error(f"there is no figure {', '.join(unknown)}; there are {', '.join(FIGURES)}")
    style.use(arguments.dpi)
    begin = time.perf_counter()
    runs = Runs(arguments.duration)
    for name in arguments.names or FIGURES:
        start = time.perf_counter()
        figure = FIGURES[name](runs)
        paths = style.save(figure, arguments.out, name)
        plt.close(figure)
        sizes = ", ".join(f"{path.suffix[1:]} {path.stat().st_size / 1000:.0f} kB" for path in paths)
        print(f"{name}: {sizes}, {time.perf_counter() - start:.1f} s", flush=True)
    # The tables go with the whole of the runs only.
    if not arguments.names and arguments.duration is None:
        for name, table in TABLES.items():
            page.insert(PAGE, name, table(runs))
    print(f"all of it: {time.perf_counter() - begin:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
