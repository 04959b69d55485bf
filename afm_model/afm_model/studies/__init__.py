"""Laws side by side: each over the same rates, delays, noise, friction and references, as one table."""

from .compare import compare
from .comparison import RANKED, UNDER, Comparison
from .contender import CONDITIONS, NOISE, Contender, contender
from .trial import run_trial
from .wrong_models import wrong_models

__all__ = [
    "CONDITIONS",
    "NOISE",
    "RANKED",
    "UNDER",
    "Comparison",
    "Contender",
    "compare",
    "contender",
    "run_trial",
    "wrong_models",
]
