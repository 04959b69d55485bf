"""The test sample of the paper, H = beta sin(k_x X) sin(k_y Y), and what the contact needs of it.

Lengths are nondimensional: X, Y in x_0, H in z_0. Equations: docs/theory.md (16) to (18).
"""

from ..jit import kernel
from ..sincos import sincos


@kernel
def surface(X: float, Y: float, beta: float, k_x: float, k_y: float) -> tuple[float, float, float]:
    """Height and slopes of the sample at (X, Y).

    Returns
    -------
    (H, H_X, H_Y) : floats [z_0], [z_0/x_0], [z_0/x_0]
    """
    sin_x, cos_x = sincos(k_x * X)
    sin_y, cos_y = sincos(k_y * Y)
    return (
        beta * sin_x * sin_y,
        beta * k_x * cos_x * sin_y,
        beta * k_y * sin_x * cos_y,
    )


@kernel
def effective_radius_ratio(H: float, k_x: float, k_y: float, r: float) -> float:
    """R_e / R = 1 / (1 + kappa r), with kappa the signed mean curvature of the sample, docs/theory.md (17).

    The curvature is taken in coordinates scaled by x_0 and z_0, kappa = (k_x^2 + k_y^2) H / 2: positive on a hill (the
    contact is smaller), negative in a valley (larger). Valid while 1 + kappa r > 0, checked when parameters are read.
    """
    return 1.0 / (1.0 + 0.5 * (k_x * k_x + k_y * k_y) * H * r)
