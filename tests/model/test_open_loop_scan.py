"""Claims about an image that is scanned in open loop with hysteresis and creep: docs/figures/open_loop_scan."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

from figures import scan as figure  # noqa: E402
from figures.scan import CERAMIC, CREEP, LINE_RATE, OFFSET, OPENING, SIZE, STROKE, Scan, scan, shifts  # noqa: E402

LINES = 3
CORNER, END = OFFSET - 0.5 * SIZE, OFFSET + 0.5 * SIZE


@pytest.fixture(scope="module")
def ideal() -> Scan:
    return scan({}, LINES)


@pytest.fixture(scope="module")
def distorted() -> Scan:
    return scan(CERAMIC, LINES)


def first_curve(u: np.ndarray | float) -> np.ndarray:
    """Rayleigh's law at the half octaves of half the stroke, and straight between them [m]."""
    U = 0.5 * STROKE
    knots = U * np.array([0.0, *2.0 ** (0.5 * np.arange(-12, 1))])
    return np.interp(u, knots, (1.0 - 2.0 * OPENING) * knots + 2.0 * OPENING / U * knots**2)


def hysteresis(x: np.ndarray) -> np.ndarray:
    """What the piezo makes of the frame's x by Masing's rule: first curve to the corner, then one loop for ever."""
    corner = -first_curve(-CORNER)
    far = corner + 2.0 * first_curve(0.5 * SIZE)
    rising = np.concatenate([[True], np.diff(x) >= 0.0])
    begin = np.argmin(x)
    first = np.arange(len(x)) <= begin
    loop = np.where(
        rising,
        corner + 2.0 * first_curve(np.clip(0.5 * (x - CORNER), 0.0, None)),
        far - 2.0 * first_curve(np.clip(0.5 * (END - x), 0.0, None)),
    )
    return np.where(first, -first_curve(np.abs(x)), loop)


def crept(h: np.ndarray, time: np.ndarray, at: float) -> float:
    """Position at a time: every change of h goes on by the logarithm of the time since (by superposition)."""
    k = np.searchsorted(time, at)
    ages = np.maximum(at - time[1:k], 5e-4)
    return float(np.interp(at, time, h) + CREEP * (np.diff(h[:k]) @ np.log10(ages / 0.1)))


def ringing(time: float) -> float:
    """What the turn of a line leaves of the scanner's oscillation, 500 Hz with Q = 20, after some time [m]."""
    w, turn = 2.0 * np.pi * 500.0, 2.0 * SIZE * 2.0 * LINE_RATE
    return float(turn / w * np.exp(-w * time / 40.0))


def test_every_edge_is_where_hysteresis_and_creep_put_it_within_half_a_thousandth_of_the_scan(ideal, distorted):
    h = hysteresis(distorted.asked)
    half = 0.5 / LINE_RATE
    found = 0
    for line in range(LINES):
        for retrace in (False, True):
            true = ideal.edges(line, retrace=retrace)
            begin = figure.APPROACH + half * (2 * line + retrace)
            for place in distorted.edges(line, retrace=retrace):
                way = END - place if retrace else place - CORNER
                x = crept(h, distorted.time, begin + half * way / SIZE)
                assert np.abs(true - x).min() < 0.5e-3 * SIZE + ringing(half * way / SIZE)
                found += 1
    assert found == 54


def test_retrace_is_shifted_by_the_opening_of_the_loop(ideal, distorted):
    # Without creep: where the rising and the falling branch pass the middle.
    middle = first_curve(0.5 * SIZE)
    half = brentq(lambda u: 2.0 * first_curve(0.5 * u) - middle, 0.0, SIZE) - 0.5 * SIZE
    assert 2.0 * half / SIZE == pytest.approx(0.063, abs=5e-4)
    no_creep = scan(CERAMIC | {"piezo.creep": 0.0}, 1)
    assert shifts(no_creep, 0).max() == pytest.approx(2.0 * half / SIZE, abs=1e-3)
    # Creep makes it larger: the numbers of docs/imperfections.md.
    assert shifts(distorted, LINES - 1).max() == pytest.approx(0.073, abs=5e-4)
    assert np.abs(shifts(ideal, 0)).max() < 2e-3


def test_creep_of_the_way_to_the_frame_bends_its_first_lines(ideal, distorted):
    first, second, third = (distorted.edges(line)[4] for line in range(LINES))
    assert (second - first) / SIZE == pytest.approx(0.008, abs=5e-4)
    assert 0.0 < third - second < 0.5 * (second - first)
    assert ideal.edges(0)[4] == pytest.approx(ideal.edges(2)[4], abs=1e-8)


def test_page_shows_the_figure():
    assert "figures/open_loop_scan.png" in (ROOT / "docs" / "imperfections.md").read_text()
    for kind in ("png", "svg"):
        assert (ROOT / "docs" / "figures" / f"open_loop_scan.{kind}").stat().st_size < 200_000
