"""The ideal piezo: no hysteresis, no creep."""

from ..compiled.jit import kernel
from ..compiled.records import Record
from ..parts.groups import PiezoParameters
from ..parts.part import Piezo
from ..parts.signals import Drive


@kernel
def actuate(t: float, u: Drive, v: Drive, p: Record, s: Record) -> None:
    """See `afm_model.parts.Piezo`."""
    v.voltage[0] = u.voltage[0]
    v.voltage[1] = u.voltage[1]
    v.voltage[2] = u.voltage[2]


LINEAR = Piezo(name="linear", parameters=PiezoParameters, actuate=actuate)
