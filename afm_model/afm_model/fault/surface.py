"""Faults of the sample: another friction, a thermal drift."""

from ..compiled.jit import kernel
from ..parts.signals import Displacement
from .memory import Constants, Memory
from .schedule_entry import AXES, KINDS, TARGETS

_FRICTION, _THERMAL = (list(KINDS).index(name) + 1 for name in ("friction", "thermal"))
_X, _Y, _Z = (TARGETS.index(axis) for axis in AXES)


@kernel
def disturb_sample(k: int, d: Displacement, p: Constants, unused: Memory) -> None:
    """Write what is wrong with the sample during tick k into the record d of Displacement."""
    d.there = 0
    d.friction, d.x, d.y, d.z = 1.0, 0.0, 0.0, 0.0
    for i in range(p.count):
        if k < p.first[i]:
            continue
        if p.kind[i] == _FRICTION and k < p.last[i]:
            d.there = 1
            d.friction *= p.magnitude[i]
        elif p.kind[i] == _THERMAL:
            d.there = 1
            # What has drifted does not come back when it drifts no more.
            moved = p.magnitude[i] * (min(k, p.last[i]) - p.first[i]) * p.control_period
            if p.target[i] == _X:
                d.x += moved / p.x0
            elif p.target[i] == _Y:
                d.y += moved / p.x0
            else:
                d.z += moved / p.z0
