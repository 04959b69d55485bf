"""Laws side by side: each over the same rates, delays, noise, friction and references, as one table."""

from .compare import compare
from .conditions import CONDITIONS, NOISE
from .contender import Contender, contender
from .result import RANKED, UNDER, Comparison
from .trial import run_trial

__all__ = ["CONDITIONS", "NOISE", "RANKED", "UNDER", "Comparison", "Contender", "compare", "contender", "run_trial"]
