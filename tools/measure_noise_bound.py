"""What noise leaves of the error along the motion, when positions and the lateral force are all that is measured.

python tools/measure_noise_bound.py           # print the table

A scanner that slips along x = y obeys one linear model: position, speed, bound of friction and its slope along the way.
How well it is known is told by the Riccati equation. A drive that answers a measurement acts a delay later and is held:
the error at the end of its period is at least the uncertainty of the prediction to there (docs/laws.md, section 8). The
bend of the surface is the largest that the law assumes; a flatter one leaves less.
"""

import math
import sys

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from afm_model import ControllerParameters, build
from afm_model.law.predictive.predictive_constants import values

SPEED = 0.1 * math.sqrt(2.0)
"""Of the reference, sine of 5 nm and 50 rad/s on x and y, where it is fastest [x0 w0]."""
AMPLITUDE = 20.0
"""[x0]"""


def uncertainties(period: float, delay: int) -> tuple[float, float]:
    """Rms error of an axis in percent of the amplitude: of the estimate, and of the position a delay and a hold later.

    Parameters
    ----------
    period : float [s]
    delay : int
        Control periods.
    """
    law = {"law.kind": "predictive", "law.feedback": "measured", "law.period": period, "law.delay_ticks": delay}
    p = values(build(ControllerParameters, law))
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


def main() -> int:
    """Print the table."""
    print("| period + delay | estimate, rms [%] | at the end of the drive, rms [%] | 3 deviations [%] |")
    print("| --- | --- | --- | --- |")
    for name, period, delay in (("100 us + 1", 1e-4, 1), ("200 us + 1", 2e-4, 1), ("250 us + 1", 2.5e-4, 1)):
        now, later = uncertainties(period, delay)
        print(f"| {name} | {now:.2f} | {later:.2f} | {3.0 * later:.2f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
