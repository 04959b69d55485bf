"""The picture of a session: position, error, drive, friction loop."""

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot as plt

from afm_model.scorecard import AXES
from afm_recorder_node.reader import Recording

# A long noisy curve is more than Agg can fill in one piece.
plt.rcParams["agg.path.chunksize"] = 10_000

_ABOVE: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "ncols": 4,
    "fontsize": "small",
    "frameon": False,
}
"""A legend beside the title, where it hides nothing."""


def draw_overview(recording: Recording, title: str, path: Path) -> None:
    """Draw position and reference, error, drive, and lateral force against position."""
    figure, ((top_left, top_right), (low_left, low_right)) = plt.subplots(
        2, 2, figsize=(12.0, 7.5), layout="constrained"
    )
    figure.suptitle(title)
    t = recording.time_ticks * 1e3
    nm = 1e9
    for i, (axis, colour) in enumerate((("x", "C0"), ("y", "C1"))):
        top_left.plot(t, recording.position[:, i] * nm, colour, lw=1.8, ls=("-", "--")[i], label=axis)
        same = i == 1 and np.array_equal(recording.reference[:, 0], recording.reference[:, 1])
        if not same:
            top_left.plot(
                t, recording.reference[:, i] * nm, "k:", lw=1.0, label="reference" if i == 0 else "y reference"
            )
    top_left.set_title("scanner position", loc="left")
    top_left.set(xlabel="simulated time [ms]", ylabel="position [nm]")
    top_left.legend(**_ABOVE)
    # The tip's error is of another size: it has its own axis.
    right = top_right.twinx()
    lines = right.plot(t, recording.error[:, 2] * nm, "C2", lw=0.6, alpha=0.6, label="z (tip), right axis")
    for i, (axis, colour) in enumerate((("x", "C0"), ("y", "C1"))):
        lines += top_right.plot(t, recording.error[:, i] * nm, colour, lw=1.4, ls=("-", "--")[i], label=axis)
    top_right.set_title("tracking error", loc="left")
    top_right.set(xlabel="simulated time [ms]", ylabel="x, y [nm]")
    right.set_ylabel("z of the tip [nm]")
    right.legend(handles=[*lines[1:], lines[0]], **_ABOVE)
    for i, axis in enumerate(AXES):
        low_left.plot(t, recording.drive[:, i], f"C{i}", lw=0.9, label=axis)
    low_left.set_title("piezo drive", loc="left")
    low_left.set(xlabel="simulated time [ms]", ylabel="drive [V]")
    low_left.legend(**_ABOVE)
    force = np.interp(recording.time_ticks, recording.time_samples, recording.lateral_force)
    low_right.plot(recording.position[:, 0] * nm, force * nm, "C3", lw=0.8)
    low_right.set_title("friction loop", loc="left")
    low_right.set(xlabel="scanner position x [nm]", ylabel="lateral force, x component [nN]")
    for axes in (top_left, top_right, low_left, low_right):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)
    plt.close(figure)
