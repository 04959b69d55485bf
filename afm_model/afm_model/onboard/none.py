"""No loop inside the instrument: the drive is the controller's."""

from typing import Any

from ..core.jit import kernel
from ..parts.groups import OnboardParameters
from ..parts.part import Onboard


@kernel
def regulate(t: float, d: Any, r: Any, u: Any, p: Any, s: Any) -> None:
    """See `afm_model.parts.Onboard`."""


NONE = Onboard(name="none", parameters=OnboardParameters, regulate=regulate)
