"""Piezo ceramics: what a drive comes to."""

from ..core.registry import register
from ..parts.groups import PiezoParameters
from .ceramic import CERAMIC
from .linear import LINEAR

register(LINEAR, CERAMIC)

__all__ = ["CERAMIC", "LINEAR", "PiezoParameters"]
