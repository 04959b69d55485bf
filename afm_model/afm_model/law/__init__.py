"""Control laws and their Lyapunov analysis."""

from typing import Any

from ..core.call import call
from ..core.jit import kernel
from ..core.records import Block, pointer_at, record_at
from ..core.registry import register
from ..parts.header import LAW_HEADER
from . import paper, paper_tracking
from .chirp import CHIRP
from .external import OUTSIDE, ExternalLaw
from .implicit import IMPLICIT
from .lyapunov import TANH_GAP, error_matrix, lyapunov_matrix, ultimate_bound
from .observer import OBSERVER
from .paper import PaperLaw
from .pid import PID
from .predictive import PREDICTIVE
from .sampled import SampledLaw, TimingWarning, disagreements
from .super_twisting import SUPER_TWISTING

EXTERNAL = -2
"""Number of the law that is not here: the drive comes from elsewhere."""
PARTS = paper.PARTS
_OF_THE_PAPER = len(paper.PARTS)
register(*PARTS)
# The others are called by address, like those of somebody else's: the compiled loop knows the paper's alone.
register(PID, IMPLICIT, SUPER_TWISTING, OBSERVER, PREDICTIVE, *paper_tracking.PARTS, CHIRP, OUTSIDE)


@kernel
def control(t: float, y: Any, u: Any, law: Block) -> None:
    """Write into the record u of COMMAND what the law of the block `law` answers to measurement y of time t [s]."""
    g = record_at(law, 0, LAW_HEADER)
    if 0 <= g.law < _OF_THE_PAPER:
        paper.control(t, y, u, record_at(law, g.law_constants, paper.CONSTANTS), 0)
    elif g.law != EXTERNAL:
        call(g.law_control, (t, y, u, pointer_at(law, g.law_constants), pointer_at(law, g.law_state)))


__all__ = [
    "EXTERNAL",
    "PARTS",
    "TANH_GAP",
    "ExternalLaw",
    "PaperLaw",
    "SampledLaw",
    "TimingWarning",
    "control",
    "disagreements",
    "error_matrix",
    "lyapunov_matrix",
    "ultimate_bound",
]
