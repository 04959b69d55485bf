"""Images by tapping: two materials by phase in both branches, and a step down that is scanned too fast."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_model.microscope import Microscope

from . import style

Q, GAIN = 60.0, 1.5660
"""Quality factor; free amplitude over way of the base and Q."""
PLANT = {"Q": Q, "gap": 60e-9, "bridge_volume": 1e-26, "bridge_begin": 1.2e-9}
SAMPLE = {"pattern": "squares", "width": 20e-9, "tension": 0.0}
GRATING = {
    "kind": "grating",
    "pitch": 400e-9,
    "top": 200e-9,
    "angle": 0.8,
    "step": 40e-9,
    "edge_radius": 20e-9,
}


def tapping(free: float, share: float, **more: dict[str, object]) -> Microscope:
    """A microscope with a free amplitude of the end of the cantilever [m]."""
    onboard = {"drive_amplitude": free / (GAIN * Q), "setpoint_share": share, "time_constant": 50e-6}
    return Microscope("tapping", onboard=onboard, **more)


def _phase(axes: Axes, free: float, branch: str, lines: int) -> None:
    with tapping(free, 0.7, plant=PLANT, sample=SAMPLE) as microscope:
        microscope.approach(rate=4e-6, range=100e-9, settle=5e-3)
        image = microscope.scan(size_x=80e-9, pixels=lines, lines=lines, line_rate=8.0, overscan=0.3)
    shown = axes.imshow(np.degrees(image["phase"][0]), origin="lower", extent=(-40, 40, -40, 40), cmap="gray")
    axes.figure.colorbar(shown, ax=axes, label="phase [°]", shrink=0.8)
    axes.grid(visible=False)
    axes.set(xlabel="x [nm]", ylabel="y [nm]", title=f"free {1e9 * free:.0f} nm: {branch}")


def _step(axes: Axes) -> None:
    with tapping(20e-9, 0.8, plant={"Q": Q, "gap": 60e-9}) as microscope:
        microscope.set_sample(**GRATING)
        microscope.approach(rate=4e-6, range=100e-9, settle=5e-3)
        frame = {"size_x": 380e-9, "pixels": 95, "lines": 1}
        image = microscope.scan(**frame, line_rate=8.0)
    x, height = 1e9 * image["x"], 1e9 * image["height"][0, 0]
    axes.plot(x, height - height.min(), **style.MOTION, label="height, trace")
    axes.plot(x, 1e9 * image["amplitude_error"][0, 0], **style.SECOND, label="amplitude error")
    axes.set(xlabel="x [nm]", ylabel="[nm]", title="a step down, too fast")
    axes.set_ylim(-12.0, 62.0)
    axes.legend(loc="upper center")


def draw(lines: int) -> Figure:
    """Both branches, and the step."""
    figure, axes = plt.subplots(1, 3, figsize=(style.WIDTH, 2.3), layout="constrained")
    _phase(axes[0], 10e-9, "attraction", lines)
    _phase(axes[1], 20e-9, "repulsion", lines)
    _step(axes[2])
    return figure
