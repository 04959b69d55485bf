"""The picture of a session."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from afm_model.run.plotting import SIZE, Curves, draw
from afm_recorder_node.recording import Recording


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
