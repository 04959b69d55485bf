"""Nothing goes wrong. Also what a fault leaves alone."""

from typing import Any

from ..core.jit import kernel
from ..parts.groups import FaultParameters
from ..parts.part import Fault


@kernel
def untouched(t: float, what: Any, p: Any, s: Any, r: Any) -> None:
    """Change nothing."""


NONE = Fault(name="none", parameters=FaultParameters, on_measurement=untouched, on_drive=untouched)
