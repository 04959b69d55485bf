"""Control laws and their Lyapunov analysis."""

from ..core.registry import register
from . import paper, paper_tracking
from .chirp import CHIRP
from .external import OUTSIDE, ExternalLaw
from .implicit import IMPLICIT
from .load import LOAD
from .lyapunov import TANH_GAP, error_matrix, lyapunov_matrix, ultimate_bound
from .observer import OBSERVER
from .paper import PaperLaw
from .pid import PID
from .sampled import (
    ContactWarning,
    SampledConstants,
    SampledLaw,
    SampledState,
    TimingWarning,
    control_height,
    require_plant,
    sampled_values,
    timing_disagreements,
    warn_of_timing,
)
from .scanner import follow_flight, free_axis, times
from .super_twisting import SUPER_TWISTING

register(*paper.PARTS, PID, IMPLICIT, SUPER_TWISTING, OBSERVER, LOAD, *paper_tracking.PARTS, CHIRP, OUTSIDE)

__all__ = [
    "TANH_GAP",
    "ContactWarning",
    "ExternalLaw",
    "PaperLaw",
    "SampledConstants",
    "SampledLaw",
    "SampledState",
    "TimingWarning",
    "control_height",
    "error_matrix",
    "follow_flight",
    "free_axis",
    "lyapunov_matrix",
    "require_plant",
    "sampled_values",
    "times",
    "timing_disagreements",
    "ultimate_bound",
    "warn_of_timing",
]
