"""Numbers of `predictive` that follow from its equations, without a run; docs/laws.md, section 8.

python tools/law_bounds.py            # print the tables
python tools/law_bounds.py --write    # and put them into docs/laws.md

Noise: a scanner that slips along x = y obeys one linear model: position, speed, bound of friction and its slope along
the way. How well it is known is told by the Riccati equation. A drive that answers a measurement acts a delay later and
is held: the error at the end of its period is at least the uncertainty of the prediction to there. The bend of the
surface is the largest that the law assumes; a flatter one leaves less.

Surface: of friction over a surface that is seen under the tip only, once a period, the part is left that those
measurements do not determine, whoever computes the drive.

Stability: spectral radius of position, rate and drives on their way, for the gains of the law.
"""

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from afm_model import ControllerParameters, build
from afm_model.law.predictive.gains import transition
from afm_model.law.predictive.predictive_constants import values

sys.path.insert(0, str(Path(__file__).parent))
from make_docs import between_marks

PAGE = Path(__file__).parent.parent / "docs" / "laws.md"

SPEED = 0.1 * math.sqrt(2.0)
"""Of the reference, sine of 5 nm and 50 rad/s on x and y, where it is fastest [x0 w0]."""
AMPLITUDE = 20.0
"""[x0]"""


def constants(period: float, delay: int = 0, **law: Any) -> Any:
    """Of the law for this period [s] and delay in control periods."""
    given = {"law.kind": "predictive", "law.period": period, "law.delay_ticks": delay}
    return values(build(ControllerParameters, given | {f"law.{name}": value for name, value in law.items()}))


def uncertainties(period: float, delay: int) -> tuple[float, float]:
    """Rms error of an axis in percent of the amplitude: of the estimate, and of the position a delay and a hold later.

    Parameters
    ----------
    period : float [s]
    delay : int
        Control periods.
    """
    p = constants(period, delay, feedback="measured")
    h, f = p["hold"], p["f_0"]
    A = np.zeros((4, 4))
    A[0, 1] = A[2, 3] = 1.0
    A[1] = -p["stiffness"][:2].mean(), -p["damping"][:2].mean(), -1.0, 0.0
    Phi: NDArray[np.float64] = expm(A * h)
    # The slope of friction changes from period to period by that of the steepest bend of the surface.
    phase = 2.0 * p["wave_number"] * SPEED / math.sqrt(2.0)
    bend = p["ripple"] * f * phase * phase
    step = np.array([0.0, 0.0, 0.5 * h * h, h]) * bend
    C = np.zeros((2, 4))
    C[0, 0] = C[1, 2] = 1.0
    # Friction along x is 1 / sqrt(2) of its bound.
    V = np.diag([p["position_noise"] ** 2, 2.0 * p["force_noise"] ** 2])
    Q = np.outer(step, step) + 1e-12 * np.eye(4)
    before = solve_discrete_are(Phi.T, C.T, Q, V)
    after = before - before @ C.T @ np.linalg.solve(C @ before @ C.T + V, C @ before)
    ahead = after
    for _ in range(delay + 1):
        ahead = Phi @ ahead @ Phi.T + Q
    percent = 100.0 / (AMPLITUDE * math.sqrt(2.0))
    return percent * math.sqrt(after[0, 0]), percent * math.sqrt(ahead[0, 0])


def of_surface(period: float, delay: int) -> tuple[float, float]:
    """What a surface seen under the tip only leaves, with positions and rates known exactly.

    The height is a Gaussian process with all wave numbers up to `law.wave_number` alike, as large as that of a wave of
    `law.height`. A law knows friction at this measurement and all before, and the drive at a time is decided a delay
    and up to a period before it.

    Parameters
    ----------
    period : float [s]
    delay : int
        Control periods.

    Returns
    -------
    (friction, error) : floats
        Rms of what is not known of the ripple of friction at the end of that time, over the ripple; rms error of an
        axis there [% of the amplitude].
    """
    p = constants(period, delay, packet=20)
    end, wave = (delay + 1) * p["hold"], 2.0 * p["wave_number"] * SPEED / math.sqrt(2.0)
    ahead = (np.arange(400) + 0.5) * end / 400
    seen = -p["hold"] * np.arange(40)

    def covariance(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
        return 0.5 * p["ripple"] ** 2 * np.sinc(wave * (a[:, None] - b) / math.pi)

    known = covariance(seen, seen) + p["ratio_noise"] ** 2 * np.eye(len(seen))
    left = covariance(ahead, ahead) - covariance(ahead, seen) @ np.linalg.solve(known, covariance(seen, ahead))
    mean = p["stiffness"][:2].mean(), p["damping"][:2].mean()
    response = np.array([transition(*mean, end - t)[0][0, 1] for t in ahead]) * p["f_0"] * end / len(ahead)
    friction = math.sqrt(2.0 * left[-1, -1]) / p["ripple"]
    return friction, 100.0 * math.sqrt(response @ left @ response) / (AMPLITUDE * math.sqrt(2.0))


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
    """Each table by its mark in the page."""
    noise = ["| period + delay | estimate, rms [%] | at the end of the drive, rms [%] | 3 deviations [%] |"]
    surface = ["| period + delay | friction not known, over its ripple | error, rms [%] | 3 deviations [%] |"]
    stable = ["| period | drives as expected | one period later | two |"]
    for rows, columns in ((noise, 4), (surface, 4), (stable, 4)):
        rows.append("| " + " | ".join(["---"] * columns) + " |")
    for name, period in RATES[1:4]:
        now, later = uncertainties(period, 1)
        noise.append(f"| {name} + 1 | {now:.2f} | {later:.2f} | {3.0 * later:.2f} |")
    for name, period in RATES:
        friction, error = of_surface(period, 1)
        surface.append(f"| {name} + 1 | {friction:.2g} | {error:.2g} | {3.0 * error:.2g} |")
        stable.append(f"| {name} | " + " | ".join(f"{radius(period, late):.2f}" for late in range(3)) + " |")
    return {"bound noise": "\n".join(noise), "bound surface": "\n".join(surface), "bound stability": "\n".join(stable)}


def main() -> int:
    """Print the tables; `--write`: into the page as well."""
    page = PAGE.read_text()
    for mark, text in tables().items():
        print(text)
        page = between_marks(page, mark, text)
    if "--write" in sys.argv[1:]:
        PAGE.write_text(page)
    return 0


if __name__ == "__main__":
    sys.exit(main())
