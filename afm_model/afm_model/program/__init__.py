"""Programs: what the scanner is asked to follow, and the setpoint of the tip."""

from ..core.registry import register
from .force_curve import FORCE_CURVE, ForceCurve
from .periodic import PERIODIC, Reference
from .verbs import VERBS, Verbs

register(PERIODIC, FORCE_CURVE, VERBS)

__all__ = ["FORCE_CURVE", "PERIODIC", "VERBS", "ForceCurve", "Reference", "Verbs"]
