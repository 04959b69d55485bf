"""The friction-predicting law: estimate, predict through the drives in flight, decide."""

from ...core.elementary import square
from ...core.jit import kernel, routine
from ...parts.signals import Measurement, PiezoDrive
from .asked import ask, take_reference
from .decide import decide, refine
from .flight import answer, extend, first_of_reserve, recall, remember
from .guard import begin_anew, fall_back, finite, watch
from .joint import correct_jointly
from .map import write_map
from .nominal_plant import predict, run_copy, take_load
from .predictive_constants import KNOWN, LEARNED, Constants
from .predictive_state import State
from .sample_estimate import measured_height, take_height, take_ratio
from .slide import correct_along
from .together import begin_together, correct_together
from .unexplained import expect, explain, explain_measured


@routine
def observe(k: int, y: Measurement, p: Constants, s: State) -> None:
    """Put position and rate of the scanner at measurement k into the state."""
    x, y_, z = y.position[0] / p.x0, y.position[1] / p.x0, y.position[2] / p.z0
    if p.measured == 0 or s.started == 0.0:
        speed = p.x0 * p.w0
        s.X, s.Y, s.Z = x, y_, z
        s.V_X = y.velocity[0] / speed if p.measured == 0 else 0.0
        s.V_Y = y.velocity[1] / speed if p.measured == 0 else 0.0
        s.V_Z = y.velocity[2] / (p.z0 * p.w0) if p.measured == 0 else 0.0
        s.spread[0] = s.spread[3] = 1.0
        s.across = p.uncertain
        begin_together(p, s)
    else:
        s.X, s.Y, s.Z = s.estimate[0], s.estimate[1], s.estimate[2]
        s.V_X, s.V_Y, s.V_Z = s.estimate[3], s.estimate[4], s.estimate[5]
        if p.together != 0:
            correct_together(k, x, y_, y, p, s)
        elif p.surface != KNOWN and p.identified:
            correct_along(k, x, y_, y, p, s)
        elif p.identified:
            correct_jointly(k, x, y_, y, p, s)
        else:
            run_copy(k, y, p, s)
            i_x, i_y = x - s.X, y_ - s.Y
            s.X += p.L[0, 0] * i_x
            s.Y += p.L[1, 0] * i_y
            # What rests is set in motion by no noise.
            if s.V_X != 0.0 or s.V_Y != 0.0 or i_x * i_x + i_y * i_y > square(3.0 * p.position_noise):
                s.V_X += p.L[0, 1] * i_x
                s.V_Y += p.L[1, 1] * i_y
        i_z = z - s.Z
        s.Z += p.L[2, 0] * i_z
        s.V_Z += p.L[2, 1] * i_z
    s.estimate[0], s.estimate[1], s.estimate[2] = s.X, s.Y, s.Z
    s.estimate[3], s.estimate[4], s.estimate[5] = s.V_X, s.V_Y, s.V_Z


@kernel
def take_sample(y: Measurement, p: Constants, s: State) -> None:
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
            off = off_x * off_x + off_y * off_y - square(3.0 * p.position_noise)
            s.doubt = p.uncertain + max(off, 0.0)
        write_map(measured_height(p, s), ratio, p, s)


@kernel
def control(t: float, y: Measurement, u: PiezoDrive, p: Constants, s: State) -> None:
    """See `afm_model.parts.Law`."""
    take_reference(y, p, s)
    k = int(t * p.w0 / p.hold + 0.5)
    recall(k, y, p, s)
    observe(k, y, p, s)
    if p.adapts and p.measured == 0:
        explain(k, y, p, s)
    elif p.adapts:
        explain_measured(y, p, s)
    take_sample(y, p, s)
    watch(k, y, p, s)
    s.last = k
    s.at_x, s.at_y = s.X, s.Y
    # A drive is refined with what the next hold asks for.
    ask(p.delay * p.slot, p.horizon + max(p.count - 1, p.refined) * p.fine, p, s)
    for i in range(p.delay + p.count):
        if i >= p.delay:
            decide((i - p.delay) * p.fine, i, p, s)
            if i == p.delay and p.refined == 1:
                refine(i, p, s)
            if s.distrust > 0.0:
                fall_back((i - p.delay) * p.fine, i, p, s)
        if i < max(p.delay + p.count - 1, p.slots):
            predict(s.plan[i, 0], s.plan[i, 1], s.plan[i, 2], p, s)
        if i == p.slots - 1:
            expect(i, s)
    planned = p.delay + p.count
    if p.reserve > 0:
        extend(k, p, s)
        planned += s.reserve_end - first_of_reserve(k, p)
    s.started = 1.0
    if not finite(planned, s):
        # Nothing that led there counts: the law begins anew at the next measurement, with the drive that is in force.
        begin_anew(p, s)
        for i in range(planned):
            for axis in range(3):
                s.plan[i, axis] = y.drive[axis] / p.volts[axis]
    remember(k, planned, p, s)
    answer(planned, u, p, s)
