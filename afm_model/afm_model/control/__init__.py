"""Control laws and their Lyapunov analysis."""

from .laws import Controller
from .lyapunov import TANH_GAP, error_matrix, lyapunov_matrix, ultimate_bound

__all__ = ["TANH_GAP", "Controller", "error_matrix", "lyapunov_matrix", "ultimate_bound"]
