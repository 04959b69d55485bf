"""Draw where each law holds: its error over control period and delay, with the limits of its linear model; Bode plots.

python tools/make_maps.py            # docs/figures/maps and docs/figures/bode, some minutes
"""

import argparse
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from figures import style
from figures.runs import ROOT
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from afm_model import Comparison, ControllerParameters, SimParameters, build, compare
from afm_model.core.registry import names
from afm_model.studies import UNDER
from afm_model.studies.linear import at_timing, linearise

PERIODS = [2e-6, 5e-6, 1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3]
DELAYS = [0, 1, 2, 3, 4, 6]
LAWS = [name for name in names("law") if name not in ("open_loop", "chirp", "external", "sgn_tracking")]
LAWS.insert(LAWS.index("observer") + 1, "observer friction=learned")
BODE = (("pid", 5e-5, 0), ("super_twisting", 5e-5, 0), ("observer", 5e-5, 0), ("observer", 5e-5, 1))
"""Law, control period [s] and delay of each curve."""


def _short(error: float) -> str:
    """An error [%] in three characters."""
    if error < 0.995:
        return "<.01" if error < 0.005 else f"{error:.2f}".lstrip("0")
    return f"{error:.1f}" if error < 9.95 else f"{error:.0f}" if error < 999.5 else ">999"


def maps(comparison: Comparison) -> Figure:
    """A panel a law: error in each cell, what is under 1 % framed, what has no stable linear model hatched."""
    laws = [each.label for each in comparison.contenders]
    rows = -(-len(laws) // 3)
    figure, axes = plt.subplots(
        rows, 3, figsize=(style.WIDTH, 1.0 + 1.75 * rows), sharex=True, sharey=True, squeeze=False, layout="constrained"
    )
    colours = plt.get_cmap("RdYlGn_r").copy()
    colours.set_bad("0.35")
    for panel, law in zip(axes.flat, laws, strict=False):
        runs = comparison.table[comparison.table["law"] == law].set_index(["delay_ticks", "period"])
        ranked = runs["error_max"].where(runs["error"].isna())
        errors = np.array([[ranked.loc[(d, T)] for T in PERIODS] for d in DELAYS])
        picture = panel.imshow(
            np.ma.masked_invalid(errors), norm=LogNorm(0.01, 100.0), cmap=colours, origin="lower", aspect="auto"
        )
        for row, d in enumerate(DELAYS):
            for column, T in enumerate(PERIODS):
                error, margin = errors[row, column], runs.loc[(d, T), "margin"]
                if margin == 0.0:
                    edge = {"fill": False, "hatch": "////", "edgecolor": "0.25", "linewidth": 0.0, "alpha": 0.6}
                    panel.add_patch(Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, **edge))
                if error <= UNDER:
                    frame = {"fill": False, "edgecolor": "black", "linewidth": 1.2}
                    panel.add_patch(Rectangle((column - 0.46, row - 0.46), 0.92, 0.92, **frame))
                if np.isfinite(error):
                    colour = "white" if error > 30.0 or error < 0.03 else "black"
                    panel.text(column, row, _short(error), ha="center", va="center", fontsize=5.0, color=colour)
        panel.set_title(law)
        panel.grid(False)
        panel.set_xticks(range(len(PERIODS)), [f"{1e6 * T:g}" for T in PERIODS], fontsize=6)
        panel.set_yticks(range(len(DELAYS)), [str(d) for d in DELAYS])
    for place, panel in enumerate(axes.flat):
        panel.set_visible(place < len(laws))
        panel.tick_params(labelbottom=place + 3 >= len(laws), labelleft=place % 3 == 0)
        panel.set_xlabel("control period [µs]" if place + 3 >= len(laws) else "")
        panel.set_ylabel("delay [periods]" if place % 3 == 0 else "")
    keys = [
        Patch(facecolor="white", edgecolor="black", linewidth=1.2, label=f"error up to {UNDER:g} %"),
        Patch(facecolor="white", edgecolor="0.25", hatch="////", linewidth=0.0, label="linear model unstable"),
        Patch(facecolor="0.35", label="not ranked: diverged, off the sample, doubtful"),
    ]
    figure.legend(handles=keys, loc="outside lower center", ncols=3)
    bar = figure.colorbar(picture, ax=axes, shrink=0.6, pad=0.02)
    bar.set_label("error, max [% of amplitude]")
    return figure


def bode() -> Figure:
    """Frequency response of the loop cut between drive and piezo along x, with the margins."""
    import control

    figure, (gain, phase) = plt.subplots(2, 1, figsize=(style.WIDTH, 4.4), sharex=True, layout="constrained")
    looks = (style.MOTION, style.SECOND, style.THIRD, style.REFERENCE)
    for (law, period, delay), look in zip(BODE, looks, strict=True):
        controller = build(ControllerParameters, {"law.kind": law})
        loop = linearise(*at_timing(SimParameters(), controller, period, delay))
        omega = np.pi / period * np.geomspace(1e-3, 0.999, 600)
        response = control.frequency_response(loop.control_system("x"), omega)
        margins = loop.margins("x")
        title = (
            f"{law}, {1e6 * period:g} µs, delay {delay}: phase margin {margins.phase:.0f}°, "
            f"further delay {1e6 * margins.delay:.0f} µs"
        )
        frequency = omega / (2.0 * np.pi)
        gain.plot(frequency, response.magnitude.squeeze(), **look, label=title)
        phase.plot(frequency, np.degrees(np.unwrap(response.phase.squeeze())), **look)
    gain.axhline(1.0, color="0.6", lw=0.6)
    gain.set(xscale="log", yscale="log", ylabel="gain of the open loop")
    gain.legend(fontsize=7, loc="lower left")
    phase.axhline(-180.0, color="0.6", lw=0.6)
    phase.set(xscale="log", xlabel="frequency [Hz]", ylabel="phase [°]")
    return figure


def main() -> int:
    """Draw both."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "figures", help="folder to write to")
    parser.add_argument("--laws", nargs="+", default=LAWS, help="laws of the map, for a quick look; default: all")
    parser.add_argument("--cycles", type=float, default=1.5, help="periods of the reference of each run")
    arguments = parser.parse_args()
    style.use()
    style.save(bode(), arguments.out, "bode")
    comparison = compare(arguments.laws, periods=PERIODS, delay_ticks=DELAYS, cycles=arguments.cycles)
    style.save(maps(comparison), arguments.out, "maps")
    return 0


if __name__ == "__main__":
    sys.exit(main())
