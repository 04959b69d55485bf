"""No loop inside the instrument: the drive is the controller's."""

from ..parts.groups import OnboardParameters
from ..parts.onboard import Onboard

NONE = Onboard(name="none", parameters=OnboardParameters)
