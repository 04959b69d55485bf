"""The pictures of a session: the overview of a run; height and friction of a scan, side by side."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from afm_model.files.layers import layers
from afm_model.files.picture import draw as draw_layer
from afm_model.microscope.image import Image
from afm_model.run.plotting import SIZE, Curves, draw
from afm_recorder_node.recording import Recording

_SIZE = (9.0, 4.4)


def draw_overview(recording: Recording, title: str, path: Path) -> None:
    """Draw a recording into a PNG file; see `afm_model.run.plotting.draw`."""
    figure = Figure(figsize=SIZE, layout="constrained")
    curves = Curves(
        time=recording.time_ticks,
        position=recording.position,
        reference=recording.reference,
        error=recording.error,
        drive=recording.drive,
        lateral_force=np.interp(recording.time_ticks, recording.time_samples, recording.lateral_force),
    )
    draw(figure, curves, title)
    figure.savefig(path, dpi=120)


def write_scan_picture(path: Path, image: Image, title: str) -> None:
    """Draw height and friction or phase, or the first two layers of a scan that lacks them, into a PNG file.

    A height counts from the lowest place of the scan; nothing else is taken off.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    every = {each.name: each for each in layers(image)}
    known = ("height_trace", "friction", "phase_trace")
    chosen = [every[name] for name in known if name in every][:2] or list(every.values())[:2]
    figure = Figure(figsize=_SIZE, layout="constrained")
    for axes, found in zip(figure.subplots(1, len(chosen), squeeze=False)[0], chosen, strict=True):
        if found.name == "height_trace" and found.measured.any():
            found = replace(found, values=found.values - np.nanmin(found.values))
        draw_layer(axes, image, found, "none")
    figure.suptitle(title)
    figure.savefig(path, dpi=120)
