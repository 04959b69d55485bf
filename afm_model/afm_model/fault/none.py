"""Nothing goes wrong."""

from ..parts.groups import FaultParameters
from ..parts.part import Fault

NONE = Fault(name="none", parameters=FaultParameters)
