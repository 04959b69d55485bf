"""Photodetectors: the truth as voltages."""

from ..core.registry import register
from .photodiode import PHOTODIODE, Photodiode

register(PHOTODIODE)

__all__ = ["PHOTODIODE", "Photodiode"]
