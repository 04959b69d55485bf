"""The reserve: drives behind those of an answer, of which each answer adds a few and keeps the others.

They bridge a controller, or a machine, that stands still for longer than an answer can be planned ahead in one go. The
scanner is predicted from where the last reserve ended. No measurement corrects that prediction; it need not be
corrected, since the drives are decided on it as on the real one, and bring it to the reference.
"""

from typing import Any

from ...core.jit import kernel, routine
from .ask import ask
from .constants import SLOTS
from .decide import decide
from .plant import predict


@kernel
def first_of_reserve(k: int, p: Any) -> int:
    """Number of the first slot behind the drives planned for measurement k."""
    return k * p.slots + p.delay + p.count


@kernel
def take_up(s: Any) -> None:
    """Put the predicted scanner where the reserve ends."""
    s.X, s.Y, s.Z = s.reserved[0], s.reserved[1], s.reserved[2]
    s.V_X, s.V_Y, s.V_Z = s.reserved[3], s.reserved[4], s.reserved[5]


@kernel
def put_down(s: Any) -> None:
    """Keep where the predicted scanner is."""
    s.reserved[0], s.reserved[1], s.reserved[2] = s.X, s.Y, s.Z
    s.reserved[3], s.reserved[4], s.reserved[5] = s.V_X, s.V_Y, s.V_Z


@routine
def extend(k: int, p: Any, s: Any) -> None:
    """Plan one control period and a slot more of the reserve, until it has its length.

    To be called with the scanner predicted to the last slot of the plan.
    """
    first, last = first_of_reserve(k, p), p.delay + p.count - 1
    if first <= s.reserve_end <= first + p.reserve:
        take_up(s)
    else:
        predict(s.plan[last, 0], s.plan[last, 1], s.plan[last, 2], p, s)
        s.reserve_end = first
    more = min(p.slots + 1, first + p.reserve - s.reserve_end)
    if more > 0:
        ask((s.reserve_end - k * p.slots) * p.slot, p.horizon + (more - 1) * p.fine, p, s)
    for i in range(more):
        decide(i * p.fine, last + 1, p, s)
        for axis in range(3):
            s.kept[s.reserve_end % SLOTS, axis] = s.plan[last + 1, axis]
        predict(s.plan[last + 1, 0], s.plan[last + 1, 1], s.plan[last + 1, 2], p, s)
        s.reserve_end += 1
    put_down(s)
    for i in range(s.reserve_end - first):
        for axis in range(3):
            s.plan[last + 1 + i, axis] = s.kept[(first + i) % SLOTS, axis]
