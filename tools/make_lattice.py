"""Draw docs/figures/lattice: the friction loop on atoms of docs/microscope.md, and the tip's way across rows of them.

python tools/make_lattice.py
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from figures import style
from figures.runs import ROOT
from matplotlib.figure import Figure

from afm_model import Scenario, changed, load_scenario, simulate
from afm_model.parameters import Value

PAGE = ROOT / "docs" / "microscope.md"


def scenario() -> Scenario:
    """The scenario of the page."""
    text = PAGE.read_text().partition("<!-- lattice -->\n```yaml\n")[2].partition("```")[0]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lattice.yaml"
        path.write_text(text)
        return load_scenario(path)


def draw() -> Figure:
    """Loops with and without heat; places of the apex with the rows turned by 45 degrees."""
    given = scenario()
    figure, (loop, way) = plt.subplots(1, 2, figsize=(style.WIDTH, 2.9), layout="constrained")
    usual = {"plant.dt": 1e-6}
    runs: tuple[tuple[str, dict[str, Value], dict[str, object]], ...] = (
        ("0 K", usual | {"plant.temperature": 0.0}, style.OVERLAY),
        ("295 K", usual, style.MOTION),
    )
    for name, values, line in runs:
        run = simulate(changed(given.sim, values), given.controller)
        period = run.time >= 0.1 - 1e-9
        loop.plot(1e9 * run.position[period, 0], 1e9 * run.lateral_force[period], label=name, **line)
    loop.set(xlabel="scanner $x$ [nm]", ylabel="lateral force [nN]")
    loop.legend(loc="lower right")

    turned: dict[str, Value] = {"sample.angle": np.pi / 4.0, "plant.temperature": 0.0, "run.duration": 0.125}
    run = simulate(changed(given.sim, turned), given.controller)
    x, y = (1e9 * run.channel(f"truth/apex_{axis}") for axis in "xy")
    forth = run.time_samples > 0.075
    a = 1e9 * run.parameters.sample.constant / np.sqrt(2.0)
    n = np.arange(-12, 13)
    rows = np.array([(i, j) for i in n for j in n if (i + j) % 2 == 0]) * a
    near = (np.abs(rows[:, 0]) < 2.0) & (np.abs(rows[:, 1] - np.median(y)) < 1.0)
    way.plot(*rows[near].T, "o", color="0.75", ms=5)
    way.plot(x[forth], y[forth], **style.SECOND)
    way.set(xlabel="apex $x$ [nm]", ylabel="apex $y$ [nm]", aspect="equal")
    return figure


if __name__ == "__main__":
    style.use()
    for drawn in style.save(draw(), ROOT / "docs" / "figures", "lattice"):
        print(f"{drawn}: {drawn.stat().st_size / 1000:.0f} kB")
