"""The load on the tip, from the deflection."""

from typing import Any

from ...core.jit import kernel


@kernel
def take_load(y: Any, p: Any, s: Any) -> None:
    """Put height of and load on the tip at a measurement into the state, with the scanner as it is there."""
    s.Q = p.a + y.deflection / p.z0
    s.load = p.w + p.eta_c2 * (s.Q - p.a)
    # Where the scanner accelerates along z by more than following the surface takes, the tip does too: at rest, and
    # after a correction.
    held = (p.w + p.eta_c2 * (s.Q - s.Z - p.a)) / (p.mu + 1.0)
    rise = y.drive[2] / p.volts[2] - p.stiffness[2] * s.Z - p.damping[2] * s.V_Z - held
    phase_rate = p.wave_number * (abs(s.V_X) + abs(s.V_Y))
    follows = p.height * phase_rate * phase_rate
    s.rise = rise - min(max(rise, -follows), follows)
    s.load += s.rise
