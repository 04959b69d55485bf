"""The friction-predicting law: estimate, predict through the drives in flight, decide."""

from typing import Any

from ...core.jit import kernel
from .ask import ask
from .constants import KNOWN, LEARNED
from .decide import decide
from .estimate import measured_height, take_height, take_ratio
from .flight import answer, recall, remember
from .load import take_load
from .map import write_map
from .observer import observe
from .plant import predict
from .reference import take_reference
from .refine import refine
from .reserve import extend, first_of_reserve


@kernel
def take_sample(y: Any, p: Any, s: Any) -> None:
    """Learn from the measurement what is to be learned of the sample."""
    take_load(y, p, s)
    if p.surface != KNOWN:
        take_height(p, s)
    ratio = 0.0
    if p.identified and (p.measured == 0 or p.surface != KNOWN):
        u_x, u_y = y.drive[0] / p.volts[0], y.drive[1] / p.volts[1]
        ratio = take_ratio(y.lateral_force / p.lateral_force, u_x, u_y, p, s)
    if p.surface == LEARNED:
        s.doubt = 0.0
        if p.measured != 0:
            # An estimate that is off by more than noise explains is wrong by that.
            off_x, off_y = y.position[0] / p.x0 - s.X, y.position[1] / p.x0 - s.Y
            off = off_x * off_x + off_y * off_y - (3.0 * p.position_noise) ** 2
            s.doubt = p.uncertain + max(off, 0.0)
        write_map(measured_height(p, s), ratio, p, s)


@kernel
def control(t: float, y: Any, u: Any, p: Any, s: Any) -> None:
    """See `afm_model.parts.Law`."""
    take_reference(y, p, s)
    k = int(t * p.w0 / p.hold + 0.5)
    recall(k, y, p, s)
    observe(k, y, p, s)
    take_sample(y, p, s)
    s.at_x, s.at_y = s.X, s.Y
    # A drive is refined with what the next hold asks for.
    ask(p.delay * p.slot, p.horizon + max(p.count - 1, p.refined) * p.fine, p, s)
    for i in range(p.delay + p.count):
        if i >= p.delay:
            decide((i - p.delay) * p.fine, i, p, s)
            if i == p.delay and p.refined == 1:
                refine(i, p, s)
        if i < p.delay + p.count - 1:
            predict(s.plan[i, 0], s.plan[i, 1], s.plan[i, 2], p, s)
    planned = p.delay + p.count
    if p.reserve > 0:
        extend(k, p, s)
        planned += s.reserve_end - first_of_reserve(k, p)
    remember(k, planned, p, s)
    answer(planned, u, p, s)
    s.started = 1.0
