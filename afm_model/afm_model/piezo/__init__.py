"""Piezo ceramics: from the drive to the motion of an ideal piezo."""

from ..core.registry import register
from ..parts.groups import PiezoParameters
from .ceramic import CERAMIC
from .ideal import LINEAR

register(LINEAR, CERAMIC)

__all__ = ["CERAMIC", "LINEAR", "PiezoParameters"]
