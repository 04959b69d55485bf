"""Numbers of `predictive` that follow from its equations, without a run; docs/predictive.md.

python tools/law_bounds.py            # print the tables
python tools/law_bounds.py --write    # and put them into docs/predictive.md

Surface: of a surface that is seen under the tip only, once a period, the part is left that those measurements do not
determine, whoever computes the drive.

Edge: friction that falls by a tenth at once throws the tip, until a drive comes that answers the first measurement
behind the edge.

Drift: what the sensors of the scanner do not see, a law that follows them does not correct.

Stability: spectral radius of position, rate and drives on their way, for the gains of the law. Of the loop with its
filter over a period of the reference: law_loop.py.
"""

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from afm_model import ControllerParameters, build
from afm_predictive.constants import values
from afm_predictive.gains import transition

sys.path.insert(0, str(Path(__file__).parent))
from law_loop import table as of_loop
from law_pages import show, table

SPEED = 0.1 * math.sqrt(2.0)
"""Of the reference, sine of 5 nm and 50 rad/s on x and y, where it is fastest [x0 w0]."""
AMPLITUDE = 20.0
"""[x0]"""
WIDTH = 8.0
"""Of the patches of the row `patches x .9` [x0]."""


def constants(period: float, delay: int = 0, **law: Any) -> Any:
    """Of the law for this period [s] and delay in control periods."""
    given = {"law.kind": "predictive", "law.period": period, "law.delay_ticks": delay}
    return values(build(ControllerParameters, given | {f"law.{name}": value for name, value in law.items()}))


def pushing(p: Any, strength: float) -> float:
    """By how much friction that falls along x = y pushes the tip away, or draws it back, a unit of way, at most."""
    f, by_load, by_curvature = strength * p["f_0"], p["eta_c2"] * p["f_load"], p["ripple"] / p["height"]
    return float(f * (by_load - by_curvature) * 0.5 * p["height"] * 2.0 * p["wave_number"] / math.sqrt(2.0))


def of_surface(period: float, delay: int, strength: float = 1.0) -> tuple[float, float, float]:
    """What a surface seen under the tip only leaves, with positions and rates known exactly.

    The height is a Gaussian process with all wave numbers up to `law.wave_number` alike, as large as that of a wave of
    `law.height`. It changes friction by the load and by its curvature. A law knows height and friction at this
    measurement and all before, and the drive at a time is decided a delay and up to a period before it. Until then an
    error changes height and friction as well: a spring that pushes back or away, by the slope there, which is that of
    the shortest wave.

    Parameters
    ----------
    period : float [s]
    delay : int
        Control periods.
    strength : float
        Friction over the nominal one.

    Returns
    -------
    (friction, error, at_most) : floats
        Rms of what is not known of the friction that the curvature makes at the end of that time, over the rms of that
        of a wave; rms error of an axis there [% of the amplitude], over all places of the wave, and at the worst one.
    """
    p = constants(period, delay, packet=20)
    q = 2.0 * p["wave_number"] / math.sqrt(2.0)
    end, rate = (delay + 1) * p["hold"], q * SPEED
    step = end / 400
    ahead, seen = (np.arange(400) + 0.5) * step, -p["hold"] * np.arange(40)
    wave_numbers = (np.arange(200) + 0.5) / 200

    def waves(times: NDArray[np.float64], of_height: float, of_curvature: float) -> NDArray[np.float64]:
        phases = np.outer(rate * times, wave_numbers)
        sizes = of_height - of_curvature * np.square(wave_numbers)
        return np.hstack([np.cos(phases) * sizes, np.sin(phases) * sizes])

    # Relative changes of friction with the height: by the load, and by the curvature of the shortest wave.
    by_load, by_curvature = p["eta_c2"] * p["f_load"], p["ripple"] / p["height"]
    known = np.vstack([waves(seen, 1.0, 0.0) / p["height_noise"], waves(seen, 0.0, by_curvature) / p["ratio_noise"]])
    certain = 8.0 * wave_numbers.size / p["height"] ** 2 * np.eye(2 * wave_numbers.size)
    of_waves = np.linalg.inv(certain + known.T @ known)
    curved = waves(ahead[-1:], 0.0, by_curvature)
    friction = math.sqrt(8.0 * (curved @ of_waves @ curved.T).item()) / p["ripple"]
    changes = waves(ahead, by_load, by_curvature)
    left = np.square(strength * p["f_0"]) * changes @ of_waves @ changes.T
    stiffness, damping = p["stiffness"][:2].mean(), p["damping"][:2].mean()
    pushes = pushing(p, strength)
    squares = []
    for place in np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False):
        # Error at the end by a push in each step before, backwards.
        response, of_end = np.empty(400), np.array([1.0, 0.0])
        for i in reversed(range(400)):
            spring = stiffness + pushes * math.sin(place + rate * ahead[i])
            response[i] = of_end[1] * step
            of_end = of_end + step * np.array([-spring * of_end[1], of_end[0] - damping * of_end[1]])
        squares.append(response @ left @ response)
    percent = 100.0 / (AMPLITUDE * math.sqrt(2.0))
    return friction, percent * math.sqrt(np.mean(squares)), percent * math.sqrt(max(squares))


def thrown(time: float) -> float:
    """How far an axis is thrown in a time [1/w0] in which friction has fallen by a tenth [% of the amplitude].

    The patch of less friction is WIDTH long; the drive is that for friction as it was before.
    """
    p = constants(5e-5)
    Phi, Gamma = transition(p["stiffness"][:2].mean(), p["damping"][:2].mean(), time / 2000)
    e, most = np.zeros(2), 0.0
    for i in range(2000):
        weak = SPEED * i * time / 2000 + e[0] < WIDTH * math.sqrt(2.0)
        e = Phi @ e + Gamma * (0.1 * p["f_0"] * weak)
        most = max(most, float(e[0]))
    return 100.0 * most / (AMPLITUDE * math.sqrt(2.0))


def of_edges(period: float, delay: int) -> tuple[float, float, float]:
    """What a fall of friction by a tenth leaves where nothing foretells it, whoever computes the drive.

    The tip follows the reference up to the edge. The first measurement behind the edge shows it, and the drive that
    answers acts a delay later.

    Parameters
    ----------
    period : float [s]
    delay : int
        Control periods.

    Returns
    -------
    (least, most, row) : floats
        Largest error of an axis up to that drive [% of the amplitude]: of an edge just before a measurement, just
        behind one; the largest of the edges in the third period of the row `patches x .9`.
    """
    hold, omega = 1e4 * period, 0.005
    # Places where friction falls, on the way there and back.
    there = [math.asin(x / AMPLITUDE) for x in (-WIDTH, WIDTH)]
    back = [math.pi - math.asin(x / AMPLITUDE) for x in (2.0 * WIDTH, 0.0, -2.0 * WIDTH)]
    times = [(4.0 * math.pi + angle) / omega for angle in there + back]
    row = max(math.ceil(t / hold) * hold - t for t in times)
    return thrown(delay * hold), thrown((delay + 1) * hold), thrown(row + delay * hold)


def of_drift(rate: float, periods: int = 3) -> float:
    """Error of an axis at the end of some periods of the reference, where its reading is the reference [%].

    Parameters
    ----------
    rate : float [m/s]
        Of the drift.
    periods : int
    """
    return 100.0 * rate * periods * 2.0 * math.pi / 50.0 / 5e-9


def radius(period: float, late: int, packet: int = 1) -> float:
    """Largest spectral radius of the loops of x, y, z whose drives come `late` slots after the law expects them."""
    p = constants(period, packet=packet)
    found = []
    for i in range(3):
        Phi, Gamma = transition(p["stiffness"][i], p["damping"][i], p["slot"])
        # Position, rate, and the drives on their way, the oldest last.
        A = np.zeros((2 + late, 2 + late))
        A[:2, :2] = Phi
        if late == 0:
            A -= np.outer(Gamma, p["K"][i])
        else:
            A[:2, -1], A[2, :2] = Gamma, -p["K"][i]
            A[range(3, 2 + late), range(2, 1 + late)] = 1.0
        found.append(float(max(abs(np.linalg.eigvals(A)))))
    return max(found)


RATES = (("50 us", 5e-5), ("100 us", 1e-4), ("200 us", 2e-4), ("250 us", 2.5e-4), ("500 us", 5e-4), ("1 ms", 1e-3))


def tables() -> dict[str, str]:
    """Each table by its mark in the page, but the one of the loop."""
    surface, edge, stable = [], [], []
    for name, period in RATES:
        of_each = [of_surface(period, 1, strength) for strength in (1.0, 1.5, 2.0)]
        friction, error, _ = of_each[0]
        deviations = [f"{3.0 * each[2]:.2g}" for each in of_each]
        surface.append([f"{name} + 1", f"{friction:.2g}", f"{error:.2g}", *deviations])
        edge.append([f"{name} + 1", *(f"{each:.2g}" for each in of_edges(period, 1))])
        stable.append([name, *(f"{radius(period, late):.2f}" for late in range(3))])
    rates = (("1e-15 m/s", 1e-15), ("2 nm/min, a design of low drift", 3e-11), ("1 nm/s", 1e-9))
    drift = [[name, f"{of_drift(rate, 1):.2g}", f"{of_drift(rate):.2g}"] for name, rate in rates]
    rate, worst = "period + delay", "3 deviations at the worst place [%]"
    left = ["friction not known, over its ripple", "error, rms [%]", worst, "of friction x 1.5 [%]", "x 2 [%]"]
    edges = ["edge just before a measurement [%]", "just behind one [%]", "in the row of patches [%]"]
    return {
        "bound surface": table([rate, *left], surface),
        "bound edge": table([rate, *edges], edge),
        "bound drift": table(["drift of an axis", "after one period [%]", "after three [%]"], drift),
        "bound stability": table(["period", "drives as expected", "one period later", "two"], stable),
    }


def with_loop() -> dict[str, str]:
    """All tables, that of the loop as well: it takes runs, some seconds."""
    return tables() | {"bound loop": of_loop()}


def main() -> int:
    """Print the tables; `--write`: into the page as well."""
    show(with_loop().items(), "--write" in sys.argv[1:])
    return 0


if __name__ == "__main__":
    sys.exit(main())
