"""What a client has set of scans, and the image that grows."""

import threading
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from afm_model.microscope import Image, Scan

PIXELS = 16
"""Pixels are multiples of this."""
FREE, SPEED, TIME = 0, 1, 2
"""What stays when the frame changes, as SpeedSet has it."""


class FreeScan(Scan):
    """A scan whose tip may be off the sample: real controllers scan there, too."""

    on_sample = False
    slides = False


@dataclass
class ScanState:
    """Settings, image and events of scans."""

    centre: tuple[float, float] = (0.0, 0.0)  # [m]
    size: tuple[float, float] = (500e-9, 500e-9)
    angle: float = 0.0  # clockwise [deg]
    channels: list[int] = field(default_factory=lambda: [14, 1, 2])
    pixels: int = 64
    lines: int = 64
    speeds: list[float] = field(default_factory=lambda: [5e-6, 5e-6, 0.1, 0.1])  # forward, backward [m/s], [s] a line
    stays: int = TIME
    ratio: float = 1.0
    continuous: int = 0
    bouncy: int = 0
    autosave: int = 0  # 0 all, 1 next, 2 off
    series: str = "scan"
    comment: str = ""
    modules: list[str] = field(default_factory=list)
    autopaste: int = 2
    upwards: bool = True
    image: Image | None = None
    shown: dict[int, str] = field(default_factory=dict)
    """Channels of the image, and their names in it."""
    begun: datetime | None = None
    saved: str = ""
    """Path of the file of the frame that has ended last; empty: it was not saved."""
    frames: int = 0
    """Frames that have ended."""
    line: tuple[int, int] = (-1, 3)
    """The line that has ended last, from 1, and its way: 0 forward, 1 backward, 3 none yet."""
    ended: int = 0
    """Ways of lines that have ended."""
    changed: threading.Condition = field(default_factory=threading.Condition)

    def frame(self, centre: tuple[float, float], size: tuple[float, float], angle: float) -> None:
        """Take another frame: speeds or times follow its width."""
        self.centre, self.size, self.angle = centre, size, angle
        self._follow()

    def _follow(self) -> None:
        for way in range(2):
            if self.stays == SPEED:
                self.speeds[2 + way] = self.size[0] / self.speeds[way]
            else:
                self.speeds[way] = self.size[0] / self.speeds[2 + way]

    def speed(self, values: list[float], stays: int, ratio: float) -> None:
        """Take speeds or times of a line, as `stays` says; what is not positive stays as it is."""
        self.stays = stays or self.stays
        at = (0, 1) if self.stays == SPEED else (2, 3)
        for place in at:
            if np.isfinite(values[place]) and values[place] > 0.0:
                self.speeds[place] = values[place]
        if ratio > 0.0:
            self.ratio = ratio
        self._follow()

    @property
    def line_rate(self) -> float:
        """Lines a second, trace and retrace [Hz]."""
        return 1.0 / (self.speeds[2] + self.speeds[3])

    def clear(self) -> None:
        """Have no image: the buffer was changed."""
        self.image = None
