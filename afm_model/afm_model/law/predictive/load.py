"""The load on the tip, from the deflection."""

from typing import Any

from ...jit import kernel


@kernel
def take_load(y: Any, p: Any, s: Any) -> None:
    """Put height of and load on the tip at a measurement into the state, with the scanner as it is there."""
    s.Q = p.a + y.deflection / p.z0
    s.load = p.w + p.eta_c2 * (s.Q - p.a)
    if s.V_X == 0.0 and s.V_Y == 0.0:
        # At rest the tip follows the scanner along z; while it slips along a line that it tracks it hardly moves.
        held = (p.w + p.eta_c2 * (s.Q - s.Z - p.a)) / (p.mu + 1.0)
        s.load += y.drive[2] / p.volts[2] - p.stiffness[2] * s.Z - p.damping[2] * s.V_Z - held
