"""The one loop: control ticks in compiled code, with a law in it or one tick at a time for a drive from elsewhere.

A tick: the command waits in the line; its drive, or one of its horizon, meets the fault and gets range and resolution;
at every sample of the virtual ADC the program looks, the onboard part and the piezo make of it what the plant feels;
the plant is stepped, the detector samples it, the score counts it; then everything is measured for the next tick.
"""

from ..compiled.jit import kernel
from ..compiled.records import Block, numbers_at, pointer_at, record_at, size
from ..core.converter import convert
from ..parts.dispatch import (
    actuate,
    control,
    detect,
    observe,
    on_command,
    on_measurement,
    on_sample,
    reference,
    regulate,
    step,
    watch,
)
from ..parts.header import BlockHeader, LawHeader
from ..parts.signals import (
    GIVEN,
    Actuation,
    Delivery,
    Detection,
    Displacement,
    Drive,
    Measurement,
    PiezoDrive,
    Setpoint,
    Truth,
)
from .block import LoopState
from .drift import DriftConstants, DriftState, drift, wander
from .drive import allowed, command_at, due, put_in_force
from .limits import RUNNING, GuardState, LimitConstants, has_z, take_drive, watch_limits
from .score import ScoreSums, count_step
from .sensors import SensorConstants, SensorState, sense, tell_sensors
from .wire import read_drive, write_measurement

MOVED, REFUSED, DIVERGED, STOPPED, UNREAD = range(5)
"""Outcome of a tick. STOPPED: it moved, and an order was completed or a limit has taken or returned the drive. UNREAD:
nothing was done, see `read_drive`.
"""
RANGE = 1e-3
"""Position beyond which the motion has diverged: hundreds of times the range of any scanner [m]."""
_REFERENCE_SIZE = size(Setpoint)
DRAW_TICKS = 256
"""Random numbers are drawn for so many ticks at a time, wherever blocks are taken: a run depends on its seed alone."""


@kernel
def measure(m: Block, k: int, noise: Block, position_noise: Block, faults: Block) -> None:
    """Write the measurement of control tick k, whose reference is asked for already; noise and faults are its random
    numbers.
    """
    g = record_at(m, 0, BlockHeader)
    c = record_at(m, g.loop, LoopState)
    y = record_at(m, g.measurement, Measurement)
    o = record_at(m, g.truth, Truth)
    d = record_at(m, g.detection, Detection)
    a = record_at(m, g.applied, Drive)
    detect(o, d, noise, m)
    y.deflection_voltage = d.deflection_voltage
    y.lateral_voltage = d.lateral_voltage
    y.deflection = y.deflection_voltage * c.deflection_sensitivity
    y.lateral_force = y.lateral_voltage * c.lateral_sensitivity
    drifted = record_at(m, g.drifted, DriftState)
    sensors, read = record_at(m, g.sensors, SensorConstants), record_at(m, g.read, SensorState)
    sense(o, y.deflection, drifted, sensors, read, position_noise)
    tell_sensors(y, o, drifted, sensors, read)
    for axis in range(3):
        y.drive[axis] = a.voltage[axis]
    y.drive_sequence = c.in_force
    y.newest_drive_sequence = command_at(c.received).sequence
    r = record_at(m, g.asked, Setpoint)
    for axis in range(3):
        y.reference_position[axis] = r.position[axis]
        y.reference_velocity[axis] = r.velocity[axis]
        y.reference_acceleration[axis] = r.acceleration[axis]
    delivery = record_at(m, g.delivery, Delivery)
    delivery.lost = 0.0
    on_measurement(k, k * c.control_period, y, delivery, faults, m)


@kernel
def start(m: Block, noise: Block, position_noise: Block, faults: Block) -> None:
    """The first measurement, of the plant at its start."""
    g = record_at(m, 0, BlockHeader)
    observe(record_at(m, g.truth, Truth), m)
    reference(0.0, record_at(m, g.asked, Setpoint), m)
    measure(m, 0, noise, position_noise, faults)


@kernel
def sample_channels(m: Block, c: LoopState, j: int) -> None:
    """Sample every channel into column j."""
    g = record_at(m, 0, BlockHeader)
    samples = numbers_at(c.samples, g.channel_count * c.columns)
    for channel in range(g.channel_count):
        samples[channel * c.columns + j] = m[int(m[g.channels + channel])]


@kernel
def begin_tick(m: Block) -> bool:
    """Put in force what is commanded for a control tick, and record it; False if that is not `allowed`: nothing moves.

    What the tick keeps until its end stands in its LoopState.
    """
    g = record_at(m, 0, BlockHeader)
    c = record_at(m, g.loop, LoopState)
    if not allowed(record_at(m, g.commanded, PiezoDrive)):
        return False
    drawn, random = c.draw * g.draws, numbers_at(c.random, DRAW_TICKS * g.draws)
    faults = pointer_at(random, drawn + g.faults)
    on_sample(c.k, record_at(m, g.displacement, Displacement), m)
    if g.fault_on_command != 0:
        c.received = g.received
        on_command(c.k, record_at(m, g.commanded, PiezoDrive), command_at(g.received), m)
    c.command = due(m)
    c.in_force = command_at(c.command).sequence
    put_in_force(m, c.command, 0.0, faults)
    c.z_given = record_at(m, g.limits, LimitConstants).z_inside != 0.0 and has_z(record_at(m, g.guard, GuardState))
    drifting = record_at(m, g.drift, DriftConstants)
    if drifting.on != 0.0:
        wandering = pointer_at(random, drawn + g.wander)
        wander(c.k, c.control_period, drifting, record_at(m, g.drifted, DriftState), wandering)
    if c.k >= c.score_tick:
        record_at(m, g.score, ScoreSums).ticks += 1.0
    reference((c.k + 1) * c.control_period, record_at(m, g.asked_next, Setpoint), m)

    # Tick k as it is recorded; its first sample is the one in its measurement.
    rows, first = numbers_at(c.rows, (c.row + 1) * c.width), c.row * c.width
    for i in range(c.width):
        rows[first + i] = m[g.hashed + i]
    c.column = c.row * (c.substeps // c.stride)
    sample_channels(m, c, c.column)
    c.noise, c.position_noise = drawn + g.noise, drawn + g.position_noise
    c.next_update = c.update
    return True


@kernel
def sample(m: Block, i: int) -> None:
    """What ADC and DAC do before integration step i of a tick, and the drive that the plant feels from it on."""
    g = record_at(m, 0, BlockHeader)
    c = record_at(m, g.loop, LoopState)
    a = record_at(m, g.applied, Drive)
    w = record_at(m, g.regulated, Actuation)
    v = record_at(m, g.effective, Actuation)
    d = record_at(m, g.detection, Detection)
    r = record_at(m, g.asked, Setpoint)
    drifting, drifted = record_at(m, g.drift, DriftConstants), record_at(m, g.drifted, DriftState)
    if i > 0:
        o = record_at(m, g.truth, Truth)
        random = numbers_at(c.random, DRAW_TICKS * g.draws)
        detect(o, d, pointer_at(random, c.noise), m)
        deflection = d.deflection_voltage * c.deflection_sensitivity
        sensors, read = record_at(m, g.sensors, SensorConstants), record_at(m, g.read, SensorState)
        sense(o, deflection, drifted, sensors, read, pointer_at(random, c.position_noise))
        c.noise += 2
        c.position_noise += 3
        c.column += 1
        if i == c.next_update:
            faults = pointer_at(random, c.draw * g.draws + g.faults)
            put_in_force(m, c.command, (i // c.update) * c.dac_period, faults)
            c.next_update += c.update
        sample_channels(m, c, c.column)
    w.voltage[0] = a.voltage[0]
    w.voltage[1] = a.voltage[1]
    w.voltage[2] = a.voltage[2]
    late = (i // c.stride) * c.sample_period
    now = c.k * c.control_period + late
    watch(now, d, r, m)
    if g.onboard_regulate != 0:
        z_mode = r.z_mode
        guard = record_at(m, g.guard, GuardState)
        if c.z_given != 0:
            r.z_mode, w.voltage[2] = GIVEN, guard.drive[2]
        regulate(now, d, r, w, m)
        r.z_mode = z_mode
        if c.z_given != 0:  # whatever the part has made of it
            w.voltage[2] = guard.drive[2]
        # What it has changed goes through the same converter; what has been through it stays.
        for axis in range(3):
            w.voltage[axis] = convert(w.voltage[axis], c.drive_lsb, c.drive_limit)
    actuate(now, w, v, m)
    v.amplitude, v.angular_frequency, v.phase, v.since = w.amplitude, w.angular_frequency, w.phase, w.since
    v.excited = w.excited
    v.second_amplitude, v.second_angular_frequency = w.second_amplitude, w.second_angular_frequency
    v.second_phase, v.second_since = w.second_phase, w.second_since
    if drifting.on != 0.0:
        drift(now, late, v, drifting, drifted)


@kernel
def end_tick(m: Block) -> int:
    """Measure at the end of a tick; MOVED, or DIVERGED if the position is not within RANGE."""
    g = record_at(m, 0, BlockHeader)
    c = record_at(m, g.loop, LoopState)
    o = record_at(m, g.truth, Truth)
    random = numbers_at(c.random, DRAW_TICKS * g.draws)
    faults = pointer_at(random, c.draw * g.draws + g.faults)
    for i in range(_REFERENCE_SIZE):
        m[g.asked + i] = m[g.asked_next + i]
    c.k += 1
    c.row += 1
    c.draw = (c.draw + 1) % DRAW_TICKS
    measure(m, c.k, pointer_at(random, c.noise), pointer_at(random, c.position_noise), faults)
    # NaN is within no range either. The true position: a sensor that fails is no motion.
    for axis in range(3):
        if not abs(o.position[axis]) < RANGE:
            return DIVERGED
    return MOVED


@kernel
def tick(m: Block) -> int:
    """Apply what is commanded for one control tick of the instrument with the block m, and measure at its end.

    Returns MOVED; REFUSED if the command is not `allowed`, with nothing changed; DIVERGED if the position is not
    within RANGE.
    """
    if not begin_tick(m):
        return REFUSED
    g = record_at(m, 0, BlockHeader)
    c = record_at(m, g.loop, LoopState)
    v = record_at(m, g.effective, Actuation)
    o = record_at(m, g.truth, Truth)
    r, following = record_at(m, g.asked, Setpoint), record_at(m, g.asked_next, Setpoint)
    sums = record_at(m, g.score, ScoreSums)
    disturbance = pointer_at(numbers_at(c.random, DRAW_TICKS * g.draws), c.draw * g.draws + g.disturbance)
    t, h = c.k * c.control_period, c.control_period / c.substeps
    stride = c.stride if c.quiet == 0 else c.substeps
    scored = c.k >= c.score_tick
    for i in range(c.substeps):
        if i % stride == 0:
            sample(m, i)
        step(t + i * h, v, disturbance, m)
        observe(o, m)
        if scored:
            count_step(sums, o, r, following, (i + 1) / c.substeps, c.control_period)
    return end_tick(m)


@kernel
def command_tick(law: Block, m: Block) -> bool:
    """Have the law answer the measurement, unless a limit or an approach has the drive; False if the answer is not
    allowed. Remembers which of them had it.
    """
    g = record_at(m, 0, BlockHeader)
    c = record_at(m, g.loop, LoopState)
    u = record_at(m, g.commanded, PiezoDrive)
    external = record_at(law, 0, LawHeader).law_control == 0
    if external or record_at(m, g.delivery, Delivery).lost == 0.0:
        if not external:
            u.sequence = c.k
        # The time that a message carries, whole nanoseconds: a law sees the same here and over topics.
        control(round(c.k * c.period_ns) * 1e-9, record_at(m, g.measurement, Measurement), u, law)
    guard = record_at(m, g.guard, GuardState)
    c.phase = guard.phase
    if guard.phase != RUNNING:
        # A drive is refused also while a limit controls the drive.
        if not allowed(u):
            return False
        take_drive(m, c.k >= c.score_tick)
    return True


@kernel
def after_tick(outcome: int, m: Block) -> int:
    """Return the outcome of a tick with what the limits have done after it, and whether an order is done."""
    g = record_at(m, 0, BlockHeader)
    c = record_at(m, g.loop, LoopState)
    if outcome != REFUSED:
        c.done += 1
    if outcome == MOVED and record_at(m, g.limits, LimitConstants).on != 0.0:
        watch_limits(m, c.k)
        if record_at(m, g.guard, GuardState).phase != c.phase:
            outcome = STOPPED
    if c.halt != 0 and m[c.halt] != 0.0:
        c.halt = 0
        if outcome == MOVED:
            outcome = STOPPED
    return outcome


@kernel
def advance(law: Block, ticks: float, m: Block) -> int:
    """Up to `ticks` control ticks: at each, the law's answer to the measurement is the drive.

    Parameters
    ----------
    law : ndarray
        Block of a law; of one without a function for a drive that has been commanded from elsewhere; of a `Wire`.
    ticks : float
        No more than there are rows left. Python hands a float over sooner than an int, and each array for a tenth of a
        microsecond: all others are found by their addresses in the block.
    m : ndarray
        Block of the instrument.

    Returns
    -------
    int
        Outcome of the last tick tried. The loop's record has how many were done, one that diverged included. They
        are fewer where the program's order is done (`halt` of LoopState), once, or a limit has acted.
    """
    c = record_at(m, record_at(m, 0, BlockHeader).loop, LoopState)
    c.done = 0
    if not read_drive(law, m):
        return UNREAD
    outcome = MOVED
    while c.done < ticks and outcome == MOVED:
        if not command_tick(law, m):
            return REFUSED
        outcome = after_tick(tick(m), m)
    write_measurement(law, m)
    return outcome
