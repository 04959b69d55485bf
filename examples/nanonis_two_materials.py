"""Two materials through the Nanonis TCP protocol, with the vendor's wrapper alone: `pip install nanonis_spm numpy`.

Start a microscope first: `afm nanonis two_materials --factor 4`. This program approaches, finds the edge between the
materials by their friction, and measures force curves on both sides of it.
"""

import argparse
import socket
import time
from typing import NamedTuple

import numpy as np
from nanonis_spm import Nanonis
from numpy.typing import NDArray

WIDTH, HEIGHT, PIXELS, LINES = 400e-9, 80e-9, 128, 8
CURVES, POINTS = 8, 4000
TRIGGER = 6.0
"""Deflection at which a force curve turns [V]."""
DISTANCE = 400e-9
"""Longest way of z towards the sample [m]."""


class Material(NamedTuple):
    """Numbers of one material, each with its standard error."""

    friction: tuple[float, float]  # half the difference of trace and retrace [V]
    sensitivity: tuple[float, float]  # deflection over voltage, by the slope in contact [m/V]
    pull_off: tuple[float, float]  # deflection before the tip leaves the sample [V]


def values(answer: tuple) -> list:
    """Values of an answer of the wrapper, which leaves the text of an error to its user."""
    error, _, found = answer
    if isinstance(error, str) and error.strip():
        raise RuntimeError(error)
    return found


def mean(numbers: NDArray) -> tuple[float, float]:
    """Mean and its standard error."""
    return float(np.mean(numbers)), float(np.std(numbers, ddof=1) / np.sqrt(len(numbers)))


def approach(nanonis: Nanonis) -> None:
    """Bring the tip to the sample."""
    values(nanonis.AutoApproach_Open())
    values(nanonis.AutoApproach_OnOffSet(1))
    while values(nanonis.AutoApproach_OnOffGet())[0]:
        time.sleep(0.05)
    if not values(nanonis.ZCtrl_OnOffGet())[0]:
        raise RuntimeError("no sample was found")


def friction(nanonis: Nanonis, lateral: int) -> NDArray:
    """Scan, and return half the difference of trace and retrace [V] (line, pixel)."""
    values(nanonis.Scan_FrameSet(0.0, 0.0, WIDTH, HEIGHT, 0.0))
    values(nanonis.Scan_BufferSet([lateral], PIXELS, LINES))
    values(nanonis.Scan_SpeedSet(0.0, 0.0, 0.1, 0.1, 2, 1.0))
    values(nanonis.Scan_Action(0, 1))
    values(nanonis.Scan_WaitEndOfScan(-1))
    forward, backward = (np.array(values(nanonis.Scan_FrameDataGrab(lateral, way))[4]) for way in (1, 0))
    return 0.5 * (forward - backward)


def edge_of(strong: NDArray, x: NDArray) -> float:
    """Place of the edge that is nearest to the middle [m], by the mean line of friction."""
    line = strong.mean(axis=0)
    above = line - 0.5 * (np.percentile(line, 10) + np.percentile(line, 90))
    (crossed,) = np.nonzero(above[:-1] * above[1:] < 0.0)
    places = x[crossed] + np.diff(x)[crossed] * above[crossed] / (above[crossed] - above[crossed + 1])
    return float(places[np.argmin(np.abs(places))])


def force_curves(nanonis: Nanonis, x: float, vertical: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Measure force curves at a place; sensitivity [m/V] and pull-off [V]."""
    values(nanonis.FolMe_XYPosSet(x, 0.0, 1))
    values(nanonis.ZSpectr_ChsSet([vertical]))
    values(nanonis.ZSpectr_RangeSet(150e-9, -DISTANCE))
    values(nanonis.ZSpectr_PropsSet(1, POINTS, 1, 2, 2, 2))
    values(nanonis.ZSpectr_TimingSet(0.0, 2e-3, 1.0, 0.0, 2.5e-5, 0.0, 0.0))
    values(nanonis.ZSpectr_RetractSet(1, TRIGGER, vertical, 0))
    slopes, pulls = [], []
    for _ in range(CURVES):
        z, towards, away = np.array(values(nanonis.ZSpectr_Start(1, ""))[5])
        free = np.mean(towards[: POINTS // 10])
        pressed = (towards > 0.3 * TRIGGER) & (towards < 0.9 * TRIGGER)
        slopes.append(-1.0 / np.polyfit(z[pressed], towards[pressed], 1)[0])
        pulls.append(free - away.min())
    sensitivity, (pull, error) = mean(np.array(slopes)), mean(np.array(pulls))
    # The tip leaves the sample somewhere within a step of z.
    step = DISTANCE / POINTS / sensitivity[0]
    return sensitivity, (pull, float(np.hypot(error, step / np.sqrt(12.0))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=6501)
    parser.add_argument("--stiffness", type=float, default=0.2, help="spring constant of the cantilever [N/m]")
    arguments = parser.parse_args()
    nanonis = Nanonis(socket.create_connection(("127.0.0.1", arguments.port)))
    names = values(nanonis.Signals_NamesGet())[2]
    vertical, lateral = (names.index(f"{way}. Deflection (V)") for way in ("Vert", "Horiz"))

    approach(nanonis)
    strong = friction(nanonis, lateral)
    x = WIDTH * ((np.arange(PIXELS) + 0.5) / PIXELS - 0.5)
    edge = edge_of(strong, x)
    print(f"edge at x = {1e9 * edge:.1f} nm")
    for side, place in (("left", edge - 40e-9), ("right", edge + 40e-9)):
        near = np.abs(x - place) < 20e-9
        slope, pull = force_curves(nanonis, place, vertical)
        found = Material(mean(strong[:, near].mean(axis=1)), slope, pull)
        newtons = 1e9 * arguments.stiffness * found.sensitivity[0] * found.pull_off[0]
        words = ", ".join(f"{name} {value:.6g} +- {error:.2g}" for name, (value, error) in found._asdict().items())
        print(f"{side}: {words}; adhesion {newtons:.2f} nN")
    values(nanonis.ZCtrl_Withdraw(1, -1))
    nanonis.close()


if __name__ == "__main__":
    main()
