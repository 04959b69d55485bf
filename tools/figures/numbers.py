"""The numbers of docs/paper.md, from the runs behind the figures."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from afm_model import Simulation
from afm_model.parameters import Value

from .runs import Runs, control_force, errors, scored, units

Column = tuple[str, str, dict[str, Value]]
"""Title, scenario, what differs from the scenario."""

OPEN_LOOP: tuple[Column, ...] = (
    ("paper's plant, z held", "paper_4_1", {}),
    ("paper's plant, z computed", "paper_4_1", {"plant__z": "computed"}),
    ("compliant plant", "paper_4_1", {"plant__kind": "compliant"}),
)
_COMPUTED: dict[str, Value] = {"plant__z": "computed"}
_COMPLIANT: dict[str, Value] = {"plant__kind": "compliant", "law__z_rate": "sample"}
CLOSED_LOOP: tuple[Column, ...] = (
    ("sgn, $f_z$ drawn", "paper_4_2_sgn", {}),
    ("sgn, computed", "paper_4_2_sgn", _COMPUTED),
    ("sgn, compliant plant", "paper_4_2_sgn", _COMPLIANT),
    ("tanh, $f_z$ drawn", "paper_4_2_tanh", {}),
    ("tanh, computed", "paper_4_2_tanh", _COMPUTED),
    ("tanh, compliant plant", "paper_4_2_tanh", _COMPLIANT),
)
HALF: dict[str, Value] = {"run__duration": 0.625 * 2.0 * np.pi / 50.0}
"""Five eighths of the period of the reference."""


def open_loop(runs: Runs, columns: Sequence[Column] = OPEN_LOOP) -> list[str]:
    """Section 4.1, second period, as a table."""
    cells = []
    for _, name, values in columns:
        run = runs(name, **values)
        unit, score = units(run.parameters), run.score
        f = [1e9 * v / unit.force for v in score.friction]
        n = [1e9 * v / unit.load for v in score.normal_force]
        extent, rms = 1e9 * score.extent / unit.length, 1e9 * score.rms / unit.length
        cells.append(
            [
                f"{score.stick_phases}",
                f"{100.0 * score.stick_fraction:.1f} %",
                *(f"{v:.1f} ({v * unit.length:.1f} nm)" for v in extent[:2]),
                *(f"{v:.1f}" for v in rms[:2]),
                f"{f[0]:.2f} to {f[1]:.2f}",
                f"{n[0]:.3f} to {n[1]:.3f}",
            ]
        )
    rows = (
        "stick phases",
        "time at rest",
        "largest |x| [$x_0$]",
        "largest |y| [$x_0$]",
        "rms $x - x_r$ [$x_0$]",
        "rms $y - y_r$ [$x_0$]",
        "friction bound [15 nN]",
        "normal force [60 nN]",
    )
    return _table("section 4.1, second period", [title for title, _, _ in columns], rows, cells)


def closed_loop(runs: Runs, columns: Sequence[Column] = CLOSED_LOOP, **common: Value) -> list[str]:
    """Section 4.2, half a period after the first eighth, as a table; `common` holds for all columns."""
    cells = []
    for _, name, values in columns:
        # The runs of the figures are longer and already there.
        run = runs(name, **HALF | values | common) if values or common else runs(name)
        unit = units(run.parameters)
        e = errors(run)[settled(run)]
        rms = np.sqrt(np.mean(e**2, axis=0))
        force = control_force(run)[settled(run), 0]
        variation = np.abs(np.diff(force)).sum() / (len(force) * run.parameters.plant.control_period)
        cells.append(
            [
                f"{rms[0]:.4f} ({1e3 * rms[0] * unit.length:.2g} pm)",
                f"{rms[2]:.4f} ({1e3 * rms[2] * unit.length:.2g} pm)",
                f"{1e3 * rms[4] * unit.height:.3g} pm",
                f"{np.abs(force).max():.0f} nN",
                f"{variation * unit.time * 1e-3 / unit.force:.2g}",
                f"{np.abs(unknown(run)[settled(run)[:-1]]).max():.2g}" if values is not _COMPLIANT else "",
            ]
        )
    rows = (
        "rms $e_x$ [$x_0$]",
        "rms $e_y$ [$x_0$]",
        "rms $e_z$",
        "largest control force along $x$",
        "total variation of $U_x$ per unit of time",
        "largest $|f_z|$",
    )
    return _table("section 4.2", [title for title, _, _ in columns], rows, cells)


def settled(run: Simulation) -> NDArray[np.bool_]:
    """Half a period after its first eighth, in which the law catches the reference up."""
    eighth = run.parameters.reference.period / 8.0
    part = (run.time >= eighth) & (run.time < 5.0 * eighth)
    return part if part.any() else scored(run)


def unknown(run: Simulation) -> NDArray[np.float64]:
    """f_z of e_z'' = -c e - cdot e' + v + f_z from each tick to the next, of a law fed by the rate of the tip."""
    e = errors(run)[:, 4:]
    # The drive tells v: U_z = (eta_z^2 + eta_c^2/mu) Q + 2 xi_z eta_z Q' + (1 + 1/mu) (...).
    p = run.parameters
    eta_z, eta_c = (2.0 * np.pi * f / p.scales.w0 for f in (p.scanner.f_z, p.cantilever.f_c))
    mu, xi = p.scanner.mass_ratio, p.scanner.xi_z
    u = run.drive[:, 2] * eta_z**2 * p.piezo.sensitivity_z / p.scales.z0
    height = e[:, 0] + run.reference[:, 2] / p.scales.z0
    law = (u - (eta_z**2 + eta_c**2 / mu) * height - 2.0 * xi * eta_z * e[:, 1]) / (1.0 + 1.0 / mu)
    return np.asarray(np.diff(e[:, 1]) / (p.plant.control_period * p.scales.w0) - law[:-1])


def _table(corner: str, heads: list[str], rows: tuple[str, ...], columns: list[list[str]]) -> list[str]:
    lines = [f"| {corner} | " + " | ".join(heads) + " |", "|---|" + "---|" * len(heads)]
    for i, row in enumerate(rows):
        lines.append("| " + row.replace("|", "\\|") + " | " + " | ".join(column[i] for column in columns) + " |")
    return lines
