"""Laws side by side: each over the same rates, delays, noise, friction and references, as one table."""

from .compare import compare
from .comparison import RANKED, UNDER, Comparison
from .contender import CONDITIONS, NOISE, Contender, contender, contenders
from .trial import Trial, run_trials
from .wrong_models import wrong_models

__all__ = [
    "CONDITIONS",
    "NOISE",
    "RANKED",
    "UNDER",
    "Comparison",
    "Contender",
    "Trial",
    "compare",
    "contender",
    "contenders",
    "run_trials",
    "wrong_models",
]
