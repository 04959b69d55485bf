"""Apply the faults of a signal: of the value of a sensor, or of the drive that is put in force."""

import math

from ..compiled.jit import kernel
from ..compiled.records import Block
from ..core.random_numbers import bits, normal
from ..parts.signals import Drive, Measurement
from .memory import Constants, Memory
from .schedule_entry import DRIVES, KINDS, SENSORS, TARGETS

_KINDS = list(KINDS)
_NOISE, _DROPOUT, _STUCK, _OFFSET, _DRIFT, _SATURATION = (
    _KINDS.index(name) + 1 for name in ("noise", "dropout", "stuck", "offset", "drift", "saturation")
)
_DEFLECTION, _RATE, _LATERAL = (TARGETS.index(name) for name in ("deflection", "deflection_rate", "lateral_force"))
_POSITION, _VELOCITY, _DRIVE = (TARGETS.index(name) for name in ("position_x", "velocity_x", "drive_x"))
_LAST_SENSOR, _LAST_DRIVE = TARGETS.index(list(SENSORS)[-1]), TARGETS.index(list(DRIVES)[-1])


@kernel
def _spoiled(x: float, i: int, t: float, number: int, p: Constants, f: Memory) -> float:
    """What fault i makes of value x at time t [s]; `number` is that of the tick or update, for what is drawn."""
    kind, size = p.kind[i], p.magnitude[i]
    if kind == _NOISE:
        return x + size * normal(bits(p.seed[i], number), p.target[i])
    if kind == _DROPOUT:
        return 0.0
    if kind == _STUCK:
        if f.begun[i] == 0:
            f.begun[i] = 1
            f.held[i] = x
        return float(f.held[i])
    if kind == _OFFSET:
        return x + size
    if kind == _DRIFT:
        return x + size * (t - p.first[i] * p.control_period)
    if kind == _SATURATION:
        return min(max(x, -size), size)
    return x


@kernel
def spoil_measurement(k: int, y: Measurement, p: Constants, f: Memory) -> None:
    """Let the faults of sensors change the measurement y of tick k."""
    t = k * p.control_period
    for i in range(p.count):
        target = p.target[i]
        if not (_DEFLECTION <= target <= _LAST_SENSOR and p.first[i] <= k < p.last[i]):
            continue
        if target == _DEFLECTION:
            y.deflection = _spoiled(y.deflection, i, t, k, p, f)
            y.deflection_voltage = y.deflection / p.deflection_sensitivity
        elif target == _RATE:
            y.deflection_rate = _spoiled(y.deflection_rate, i, t, k, p, f)
        elif target == _LATERAL:
            y.lateral_force = _spoiled(y.lateral_force, i, t, k, p, f)
            y.lateral_voltage = y.lateral_force / p.lateral_sensitivity
        elif target < _VELOCITY:
            axis = target - _POSITION
            y.position[axis] = _spoiled(y.position[axis], i, t, k, p, f)
        else:
            axis = target - _VELOCITY
            y.velocity[axis] = _spoiled(y.velocity[axis], i, t, k, p, f)


@kernel
def spoil_drive(k: int, t: float, u: Drive, p: Constants, f: Memory, unused: Block) -> None:
    """Let the faults of drives change drive u, put in force at time t [s] in tick k."""
    number = math.floor(t / p.dac_period + 0.5)
    for i in range(p.count):
        if _DRIVE <= p.target[i] <= _LAST_DRIVE and p.first[i] <= k < p.last[i]:
            axis = p.target[i] - _DRIVE
            u.voltage[axis] = _spoiled(u.voltage[axis], i, t, number, p, f)
