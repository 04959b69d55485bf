"""Faults of messages: measurements and drives that are late or get lost.

Messages may overtake one another. The newest one that has arrived counts, by the number of its tick.
"""

import math

from ..compiled.jit import kernel
from ..compiled.records import numbers_at, numbers_of, record_at, size
from ..core.random_numbers import bits, uniform
from ..parts.signals import Delivery, Measurement, PiezoDrive, copy_command
from ..parts.ticks import ticks_of
from .memory import SENSED, SLOTS, Constants, Memory, OnTheirWay
from .schedule_entry import KINDS, LATENCY_TICKS, MESSAGES, TARGETS

_KINDS = list(KINDS)
_LATENCY, _JITTER, _LOSS = (_KINDS.index(name) + 1 for name in ("latency", "jitter", "loss"))
MEASUREMENT_MESSAGE, DRIVE_MESSAGE = (TARGETS.index(name) for name in MESSAGES)
_NEVER = -1
_SIZE = size(OnTheirWay)

_ticks_of = kernel(ticks_of)


@kernel
def _arrival(k: int, message: int, p: Constants) -> int:
    """Tick at which the message of tick k arrives; negative if it gets lost."""
    late = 0
    for i in range(p.count):
        if p.target[i] != message or not p.first[i] <= k < p.last[i]:
            continue
        if p.kind[i] == _LOSS:
            if uniform(bits(bits(p.seed[i], k), message)) < p.magnitude[i]:
                return _NEVER
        elif p.kind[i] == _LATENCY:
            late += _ticks_of(p.magnitude[i], p.control_period)
        elif p.kind[i] == _JITTER:
            late += math.floor(uniform(bits(bits(p.seed[i], k), message)) * (p.magnitude[i] / p.control_period + 1.0))
    return int(k + min(late, LATENCY_TICKS))


@kernel
def delay_measurement(k: int, y: Measurement, e: Delivery, p: Constants, f: Memory) -> None:
    """Replace the sensor values of measurement y by those that have arrived by tick k.

    e shows whether there is a message at all.
    """
    arrives = _arrival(k, MEASUREMENT_MESSAGE, p)
    # The first one finds its way: without it nobody would know that the run has begun.
    if k == 0:
        arrives = 0
    elif arrives < 0:
        e.lost = 1.0
    told, sent = numbers_of(y), record_at(numbers_at(f.messages, _SIZE), 0, OnTheirWay)
    slot = k % SLOTS
    sent.shown_at[slot] = arrives
    for i in range(SENSED):
        sent.sensed[slot, i] = told[i]
    j = k
    while j > f.shown and j > k - SLOTS:
        if 0 <= sent.shown_at[j % SLOTS] <= k:
            f.shown = j
            break
        j -= 1
    slot = f.shown % SLOTS
    for i in range(SENSED):
        told[i] = sent.sensed[slot, i]


@kernel
def delay_command(k: int, u: PiezoDrive, arrived: PiezoDrive, p: Constants, f: Memory) -> None:
    """Write what has arrived by tick k, of the commands up to u of this tick."""
    v, sent = f.passed_voltage, record_at(numbers_at(f.messages, _SIZE), 0, OnTheirWay)
    same = u.voltage[0] == v[0] and u.voltage[1] == v[1] and u.voltage[2] == v[2]
    new = u.sequence != f.passed
    f.passed = u.sequence
    for axis in range(3):
        v[axis] = u.voltage[axis]
    slot = k % SLOTS
    # In real time a drive is held until the next message comes: that is none.
    sent.arrives_at[slot] = _arrival(k, DRIVE_MESSAGE, p) if new else _NEVER
    if not new and not same:
        # Nor is what the instrument does by itself, as when it retracts the sample: that takes effect at once.
        sent.arrives_at[slot] = k
    if sent.arrives_at[slot] >= 0:
        copy_command(u, record_at(sent.commands[slot], 0, PiezoDrive))
    j = k
    while j > f.in_force and j > k - SLOTS:
        if 0 <= sent.arrives_at[j % SLOTS] <= k:
            f.in_force = j
            copy_command(record_at(sent.commands[j % SLOTS], 0, PiezoDrive), arrived)
            break
        j -= 1
