"""Numbers that are stored and given back in another form than they were set in."""

from dataclasses import dataclass, field


@dataclass
class Numbers:
    """Of commands that are no pair of a Set and a Get."""

    gain: int = 0
    filter: int = 0
    drift: tuple[int, float, float, float, float] = (0, 0.0, 0.0, 0.0, 10.0)  # on, velocities [m/s], limit [%]
    motor: tuple[float, float] = (1000.0, 100.0)  # [Hz], [V]
    bases: dict[str, int] = field(default_factory=lambda: {"Osci1T": 2, "Osci2T": 2})
    """Index of the time base of each oscilloscope."""
    pll_gains: dict[tuple[str, int], tuple[float, float]] = field(default_factory=dict)
    """P and time constant [s] of loops of the PLL."""
