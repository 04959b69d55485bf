"""Measure error and cost of ways to integrate stick-slip; prints the tables of docs/numerics.md.

python tools/measure_numerics.py            # print
python tools/measure_numerics.py --write    # and put them into docs/numerics.md
"""

import argparse
import math
import sys
import time
from collections.abc import Callable, Sequence

import numpy as np
from figures.page import insert
from numerics import fixed_step as schemes
from numerics.adaptive import solve
from numerics.problem import OMEGA, ROOT, Trajectory, error, reference, start
from numpy.typing import NDArray

PAGE = ROOT / "docs" / "numerics.md"
STEPS = (0.05, 0.02, 0.01, 0.001)
FINE_STEPS = (0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 0.0005)
SMOOTHING = (1e-4, 1e-3, 1e-2, 3e-2, 1e-1)
SCHEMES: tuple[tuple[str, Callable[..., None]], ...] = (
    ("this project: midpoint, friction by disc projection", schemes.project),
    ("Moreau-Jean, theta = 1/2", schemes.moreau_jean),
    ("Moreau, semi-implicit Euler", schemes.semi_implicit_euler),
    ("RK4, friction f v/\\|v\\| in its three cases", lambda *a: schemes.runge_kutta_4(*a, 0.0, False)),
    ("RK4, sgn of each component (another law)", lambda *a: schemes.runge_kutta_4(*a, 0.0, True)),
)
ADAPTIVE = (
    ("RK45", 1e-6, 0.0),
    ("LSODA", 1e-6, 1e-2),
    ("LSODA", 1e-6, 1e-3),
    ("LSODA", 1e-6, 1e-4),
)
Table = list[str]


def run(scheme: Callable[..., None], h: float, points: int) -> NDArray[np.float64]:
    """Positions at every unit of time."""
    out = np.empty((points, 2))
    scheme(start(h), round(1.0 / h), out)
    return out


def cost(scheme: Callable[..., None], points: int, repeats: int = 12) -> float:
    """Shortest processor time of one step at h = 0.01 [s]."""
    best = math.inf
    for _ in range(repeats):
        begin = time.thread_time()
        run(scheme, 0.01, points)
        best = min(best, time.thread_time() - begin)
    return best / (100.0 * points)


def fixed_table(exact: Trajectory, steps: Sequence[float]) -> Table:
    """Error against step and cost of the schemes of fixed step."""
    points = len(exact.times)
    lines = [
        "| scheme | " + " | ".join(f"h = {h:g}" for h in steps) + " | cost per step |",
        "|---|" + "---|" * (len(steps) + 1),
    ]
    unit = cost(schemes.project, points)
    for name, scheme in SCHEMES:
        errors = [error(run(scheme, h, points), exact) for h in steps]
        lines.append(
            f"| {name} | "
            + " | ".join(f"{e:.2g}" for e in errors)
            + f" | {_price(unit if scheme is schemes.project else cost(scheme, points), unit)} |"
        )
    # The regularisation is chosen anew for every step, in favour of the method.
    cells = []
    for h in steps:
        tried = [(error(run(_smooth(v_s), h, points), exact), v_s) for v_s in SMOOTHING]
        best, v_s = min(tried)
        cells.append(f"{best:.2g} ($v_s$ = {v_s:g})")
    price = _price(cost(_smooth(1e-2), points), unit)
    lines.append("| RK4, $f \\tanh(\\|v\\|/v_s)$, best $v_s$ | " + " | ".join(cells) + f" | {price} |")
    return lines


def _price(seconds: float, unit: float) -> str:
    return f"{seconds / unit:.1f} ({1e9 * seconds:.0f} ns)"


def _smooth(v_s: float) -> Callable[..., None]:
    return lambda *a: schemes.runge_kutta_4(*a, v_s, False)


def order_table(exact: Trajectory, steps: Sequence[float]) -> Table:
    """Convergence of the project's scheme across stick and slip."""
    errors = [error(run(schemes.project, h, len(exact.times)), exact) for h in steps]
    orders = np.diff(np.log(errors)) / np.diff(np.log(steps))
    return [
        "| h [$1/\\omega_0$] | " + " | ".join(f"{h:g}" for h in steps) + " |",
        "|---|" + "---|" * len(steps),
        "| error [$x_0$] | " + " | ".join(f"{e:.2g}" for e in errors) + " |",
        "| order from the step before | | " + " | ".join(f"{order:.1f}" for order in orders) + " |",
    ]


def adaptive_table(exact: Trajectory) -> Table:
    """Error and cost of solve_ivp."""
    points = len(exact.times)
    unit = cost(schemes.project, points) * 100.0 * points
    lines = [
        "| solve_ivp method | rtol | friction | error [$x_0$] | evaluations | time for the period |",
        "|---|---|---|---|---|---|",
    ]
    for method, rtol, v_s in ADAPTIVE:
        law = "$f v/\\|v\\|$" if v_s == 0.0 else f"tanh, $v_s$ = {v_s:g}"
        found = solve(exact, method, rtol, v_s)
        if math.isnan(found.error):
            result, price = f"stopped at t = {found.reached:.2f}", "-"
        else:
            result, price = f"{found.error:.2g}", f"{found.seconds / unit:.0f}"
        lines.append(f"| {method} | {rtol:g} | {law} | {result} | {found.evaluations} | {price} |")
    return lines


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="put the tables into docs/numerics.md")
    parser.add_argument("--duration", type=float, default=2.0 * math.pi / OMEGA, help="time to integrate [1/w0]")
    arguments = parser.parse_args()
    exact = reference(arguments.duration)
    tables = {
        "order": order_table(exact, FINE_STEPS),
        "fixed": fixed_table(exact, STEPS),
        "adaptive": adaptive_table(exact),
    }
    for name, lines in tables.items():
        print("\n".join(lines), end="\n\n", flush=True)
        if arguments.write:
            insert(PAGE, name, lines)
    return 0


if __name__ == "__main__":
    sys.exit(main())
