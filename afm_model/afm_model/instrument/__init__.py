"""The virtual instrument: plant, detector, reference and score behind measurement and drive."""

from .instrument import Block, DivergenceError, DriveError, Instrument
from .tally import ScoreSummary

__all__ = ["Block", "DivergenceError", "DriveError", "Instrument", "ScoreSummary"]
