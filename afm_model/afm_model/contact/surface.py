"""What the shape of the sample does to the contact. Equations: docs/theory.md (17)."""

from typing import Any

from ..core.jit import kernel


@kernel
def effective_radius_ratio(h: Any, r: float) -> float:
    """R_e / R = 1 / (1 + kappa r), with kappa the signed mean curvature of the sample, docs/theory.md (17).

    The curvature is taken in coordinates scaled by x_0 and z_0: positive on a hill (the contact is smaller), negative
    in a valley (larger). Valid while 1 + kappa r > 0, checked when parameters are read.

    Parameters
    ----------
    h : record of Surface
    r : float [z0]
        Radius of the tip.
    """
    return 1.0 / (1.0 + h.curvature * r)
