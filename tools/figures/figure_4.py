"""Figure 4 of the paper: friction against position along x and along y, in open loop."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from . import style
from .runs import Runs, friction, scored, units

PLANTS = (("paper_4_1", "paper's plant", "ab"), ("open_loop", "compliant plant", "cd"))
TEETH = (((9.0, 22.3), (63.0, 100.0)), ((12.0, 33.0), (166.0, 183.0)))
"""Parts shown magnified, along x and along y: positions [nm], friction [nN]."""


def draw(runs: Runs) -> Figure:
    """Friction loops: first row the plant of the paper, second row the plant whose contact is compliant."""
    figure, axes = plt.subplots(2, 2, figsize=(style.WIDTH, 5.6), layout="constrained", sharex="col", sharey=True)
    for row, (name, plant, letters) in zip(axes, PLANTS, strict=True):
        run = runs(name)
        unit = units(run.parameters)
        f, second = friction(run), scored(run)
        for i, axis in enumerate("xy"):
            ax = row[i]
            position = 1e9 * run.position[:, i]
            # The teeth are the subject, and the empty middle of the loop has room for them.
            inset = style.box(ax, (0.13, 0.4, 0.35, 0.27), *TEETH[i])
            (left, right), (low, high) = TEETH[i]
            inside = (position > left) & (position < right) & (f[:, i] > low) & (f[:, i] < high)
            for part, label, line in (
                (~second, "first period", style.SECOND),
                (second, "second period", style.MOTION),
            ):
                ax.plot(position[part], f[part, i], label=label, **line)
                inset.plot(np.where(inside, position, np.nan)[part], f[part, i], **line)
            ax.set_title(f"({letters[i]}) {plant}, ${axis}$", loc="left")
    unit = units(run.parameters)
    for i, axis in enumerate("xy"):
        style.opposite(axes[0, i], x=(f"${'XY'[i]}$ [$x_0$]", unit.length))
        style.opposite(axes[i, 1], y=(r"$f$ [$m_p\omega_0^2 x_0$]", unit.force))
        axes[1, i].set_xlabel(f"${axis}$ [nm]")
        axes[i, 0].set_ylabel("friction on the axis [nN]")
    axes[0, 0].legend(loc=(0.51, 0.4), handlelength=1.2, frameon=False)
    return figure
