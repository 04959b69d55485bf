"""The friction-predicting law: estimate, predict through the drives in flight, decide."""

from afm_model.parts import Measurement, PiezoDrive, kernel, routine, square

from .asked import ask, take_reference
from .constants import KNOWN, LEARNED, Constants
from .decide import decide
from .flight import answer, extend, first_of_reserve, recall, remember
from .guard import begin_anew, fall_back, finite, watch
from .map import write_map
from .nominal_plant import drive_in_force, predict, take_load
from .observer import begin_observer, observe_scanner
from .sample_estimate import (
    TOUCHES,
    approach,
    doubt_surface,
    measured_height,
    place_variance,
    take_height,
    take_ratio,
)
from .state import State
from .unexplained import expect, explain, explain_measured, find_zeros_at_start, learn_stiffness_of_z


@routine
def observe(k: int, y: Measurement, p: Constants, s: State) -> None:
    """Put position and rate of the scanner at measurement k into the state."""
    x, y_, z = y.position[0] / p.x0, y.position[1] / p.x0, y.position[2] / p.z0
    # What led to a fallback is no estimate to go on from.
    if s.started == 0.0 or s.distrust == 1.0 or p.measured == 0:
        speed = p.x0 * p.w0
        s.X, s.Y, s.Z = x, y_, z
        s.V_X = y.velocity[0] / speed if p.measured == 0 else 0.0
        s.V_Y = y.velocity[1] / speed if p.measured == 0 else 0.0
        s.V_Z = y.velocity[2] / (p.z0 * p.w0) if p.measured == 0 else 0.0
        begin_observer(p, s)
    else:
        s.X, s.Y, s.Z = s.estimate[0], s.estimate[1], s.estimate[2]
        s.V_X, s.V_Y, s.V_Z = s.estimate[3], s.estimate[4], s.estimate[5]
        observe_scanner(k, x, y_, y, p, s)
        missed = z - s.Z
        if p.adapts != 0 and p.first[2, 2] > 0.0:
            learn_stiffness_of_z(missed, p, s)
        s.Z += p.L[s.unknown, 0] * missed
        s.V_Z += p.L[s.unknown, 1] * missed
    s.estimate[0], s.estimate[1], s.estimate[2] = s.X, s.Y, s.Z
    s.estimate[3], s.estimate[4], s.estimate[5] = s.V_X, s.V_Y, s.V_Z


@kernel
def take_sample(y: Measurement, p: Constants, s: State) -> None:
    """Learn from the measurement what is to be learned of the sample."""
    take_load(y, p, s)
    if s.unknown != 0:
        take_height(p, s)
    ratio = s.grip
    if p.identified and p.measured == 0:
        u_x, u_y = drive_in_force(0, y, p, s), drive_in_force(1, y, p, s)
        ratio = take_ratio(y.lateral_force / p.lateral_force, u_x, u_y, p, s)
    approach(ratio, p, s)
    if p.surface == KNOWN and ratio > TOUCHES:
        doubt_surface(p, s)
    if p.surface == LEARNED:
        s.doubt = 0.0
        if p.measured != 0:
            # An estimate that is off by more than noise explains is wrong by that.
            off = square(y.position[0] / p.x0 - s.X) + square(y.position[1] / p.x0 - s.Y)
            s.doubt = place_variance(s) + max(off - square(3.0 * p.position_noise), 0.0)
        # As it is measured: what z is estimated wrong by goes with the motion, and would lie in the map.
        write_map(measured_height(y.position[2] / p.z0, p, s), ratio, p, s)


@kernel
def control(t: float, y: Measurement, u: PiezoDrive, p: Constants, s: State) -> None:
    """See `afm_model.parts.Law`."""
    if s.started == 0.0:
        begin_anew(p, s)
    take_reference(y, p, s)
    if s.started == 0.0:
        find_zeros_at_start(y, p, s)
    k = int(t * p.w0 / p.hold + 0.5)
    observe(k, y, p, s)
    if p.adapts and p.measured == 0:
        explain(k, y, p, s)
    elif p.adapts:
        explain_measured(y, p, s)
    take_sample(y, p, s)
    watch(k, y, p, s)
    s.last = k
    s.at_x, s.at_y = s.X, s.Y
    recall(k, y, p, s)
    ask(p.delay * p.slot, p.horizon + (p.count - 1) * p.fine, p, s)
    for i in range(p.delay + p.count):
        if i >= p.delay:
            decide((i - p.delay) * p.fine, i, p, s)
            fall_back((i - p.delay) * p.fine, i, p, s)
        if i < max(p.delay + p.count - 1, p.slots):
            predict(s.plan[i, 0], s.plan[i, 1], s.plan[i, 2], p, s)
        if i < p.slots:
            expect(i, p, s)
    planned = p.delay + p.count
    if p.reserve > 0:
        extend(k, p, s)
        planned += s.reserve_end - first_of_reserve(k, p, s)
    s.started = 1.0
    if not finite(planned, s):
        # Nothing that led there counts: the law begins anew at the next measurement, with the drive that is in force.
        s.started, s.distrust = 0.0, 1.0
        s.fallbacks += 1.0
        for i in range(planned):
            for axis in range(3):
                s.plan[i, axis] = drive_in_force(axis, y, p, s)
    remember(k, planned, p, s)
    answer(planned, u, p, s)
