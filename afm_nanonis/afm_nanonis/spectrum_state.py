"""What a client has set of spectra."""

from dataclasses import dataclass, field


@dataclass
class SpectrumState:
    """Settings of a module of spectra."""

    points: int
    channels: list[int] = field(default_factory=lambda: [1, 2, 14])
    backward: int = 1
    sweeps: int = 1
    autosave: int = 1
    dialog: int = 0
    save_all: int = 0
    base: str = "spectrum"
