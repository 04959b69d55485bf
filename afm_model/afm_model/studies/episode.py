"""What the environments of gymnasium here have in common: what they refuse, and how."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import ParameterError


def require_render_mode(env: Any, mode: str | None) -> None:
    """Refuse a render_mode that an environment does not have."""
    if mode not in (None, *env.metadata["render_modes"]):
        raise ParameterError(f"render_mode = {mode} is not allowed: it must be rgb_array, or left out")


def refuse_options(options: dict[str, Any] | None) -> None:
    """Refuse options of a reset, which would change nothing."""
    if options:
        raise ParameterError(f"options {', '.join(options)} are not allowed: reset takes a seed, and nothing else")


def checked(action: Any, shape: tuple[int, ...], what: str) -> NDArray[np.float64]:
    """Return an action as numbers of this shape; `what` it means ends the message of one that is refused.

    Raises
    ------
    ValueError
        If it is not finite, or not within -1 to 1.
    """
    given = np.asarray(action, np.float64).reshape(shape)
    if not np.isfinite(given).all():
        raise ValueError("an action must be finite numbers")
    if given.size and not abs(largest := float(given.flat[np.abs(given).argmax()])) <= 1.0:
        raise ValueError(
            f"action {largest:g} is not allowed: it must be >= -1 and <= 1, which are {what}; "
            f"gymnasium.wrappers.ClipAction clips it"
        )
    return given
