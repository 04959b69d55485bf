"""The virtual instrument: the parts behind measurement and drive, one loop, the score."""

from .instrument import Instrument
from .rows import Block, Cut
from .score import ScoreSummary

__all__ = ["Block", "Cut", "Instrument", "ScoreSummary"]
