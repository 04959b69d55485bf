"""A copy of the plant that runs along from measurement to measurement."""

from typing import Any

from ...core.jit import kernel
from .constants import ANSWERS, SLOTS
from .flight import drives_of
from .plant import predict


@kernel
def run_copy(k: int, y: Any, p: Any, s: Any) -> None:
    """Move the copy of the plant from the last measurement to measurement k, under the drives that were in force."""
    kept = max(y.drive_sequence, 0) % ANSWERS
    known = y.drive_sequence >= 0 and s.answered[kept] == y.drive_sequence
    for ahead in range(min(max(k - s.last, 1), SLOTS)):
        for j in range(p.slots):
            x, y_, z = y.drive[0] / p.volts[0], y.drive[1] / p.volts[1], y.drive[2] / p.volts[2]
            if known:
                at = max(0, min((s.last + ahead - y.drive_sequence) * p.slots + j, s.lengths[kept] - 1))
                sent = drives_of(kept, p, s)
                x, y_, z = sent[3 * at], sent[3 * at + 1], sent[3 * at + 2]
            predict(x, y_, z, p, s)
