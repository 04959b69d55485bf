"""The virtual instrument: the parts behind measurement and drive, one loop, the score."""

from .instrument import Block, Instrument
from .score import ScoreSummary

__all__ = ["Block", "Instrument", "ScoreSummary"]
