"""The virtual instrument: the parts between drive and measurement, one loop, the score."""

from .instrument import Instrument
from .rows import Block, Cut
from .score import ScoreSummary

__all__ = ["Block", "Cut", "Instrument", "ScoreSummary"]
