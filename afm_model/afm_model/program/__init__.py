"""Programs: what the scanner is asked to follow, and the setpoint of the tip."""

from ..core.registry import register
from .force_curve import FORCE_CURVE, ForceCurveParameters
from .ordered import VERBS, VerbsParameters
from .periodic import PERIODIC, Reference

register(PERIODIC, FORCE_CURVE, VERBS)

__all__ = ["FORCE_CURVE", "PERIODIC", "VERBS", "ForceCurveParameters", "Reference", "VerbsParameters"]
