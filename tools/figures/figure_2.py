"""Figure 2 of the paper: contact radius against load, JKR and Hertz, down to the pull-off point."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from afm_model.contact.jkr import contact_radius, hertz_radius, radius_at_zero_load

from . import style
from .runs import Runs


def draw(runs: Runs) -> Figure:
    """Contact radius on a flat sample."""
    contact = runs.scenario("paper_4_1").sim.contact
    K, R, gamma = contact.K, contact.R, contact.surface_energy
    pull_off = contact.pull_off_force
    a_0, a_s = (1e9 * a for a in (radius_at_zero_load(R, K, gamma), contact_radius(-pull_off, R, K, gamma)))
    # The square root at pull-off is resolved by equal steps in sqrt(1 + L/|L_s|).
    load = pull_off * (np.linspace(0.0, np.sqrt(3.0), 400) ** 2 - 1.0)
    pushing = np.linspace(0.0, load[-1] ** (1.0 / 3.0), 400) ** 3

    figure, ax = plt.subplots(figsize=(0.72 * style.WIDTH, 3.4), layout="constrained")
    jkr = [1e9 * contact_radius(max(L, -pull_off), R, K, gamma) for L in load]
    ax.plot(1e9 * load, jkr, label="JKR", **style.MOTION)
    ax.plot(1e9 * pushing, [1e9 * hertz_radius(L, R, K) for L in pushing], label="Hertz", **style.REFERENCE)
    ax.plot([-1e9 * pull_off], [a_s], "ko", ms=5)
    ax.annotate(
        f"pull-off\n$L_s$ = −{1e9 * pull_off:.1f} nN\n$a$ = {a_s:.2f} nm",
        (-1e9 * pull_off, a_s),
        xytext=(-120.0, 2.2),
        arrowprops={"arrowstyle": "-", "lw": 0.6},
    )
    ax.plot([0.0], [a_0], "ko", ms=5, mfc="white")
    ax.annotate(
        f"$a_0$ = {a_0:.2f} nm",
        (0.0, a_0),
        xytext=(-80.0, a_0 + 1.0),
        arrowprops={"arrowstyle": "-", "lw": 0.6},
    )
    ax.axvline(0.0, color="0.6", lw=0.6)
    ax.set(xlabel="load $L$ [nN]", ylabel="contact radius $a$ [nm]", ylim=(0.0, None))
    # Nondimensional: loads in |L_s|, radii in a_0.
    style.opposite(ax, x=(r"$L/|L_s|$", 1e9 * pull_off), y=("$a/a_0$", a_0))
    ax.legend(loc="lower right")
    return figure
