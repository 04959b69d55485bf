"""Instrument and law, linearised: scanner, cantilever and contact under a held drive; what a law answers to small
changes of what it has measured and of what it remembers.
"""

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import plain, routine
from ..compiled.records import Block, Record, place, record_at, size
from ..contact.friction import bound_of_load
from ..contact.jkr import stiffness_of_u, u_of_load
from ..core.registry import find
from ..instrument import Instrument
from ..instrument.controller import Controller, answer
from ..parameters import SimParameters, Value, changed, flatten
from ..parts.part import SPRING
from ..parts.signals import Measurement, PiezoDrive
from ..plant.constants import plant_constants
from ..plant.steps import contact_of

_Array = NDArray[np.float64]
AXES = ("x", "y", "z")
STATES = 8
"""States of the plant: X, V_X, Y, V_Y, Z, V_Z, Q, V_Q."""
_NOISES = {
    f"detector.{name}"
    for name in ("noise", "noise_density", "deflection_noise_density", "position_noise", "position_noise_density")
}
_VOLTAGE = place(PiezoDrive, "voltage")
_SMALL = 1e-5
"""Change by which the law is probed, in the paper's units."""
_TICKS = 200
"""Measurements after which a law has settled at what it is shown."""
_SETTLING = 4000
"""Control periods in which a stable loop comes to rest against friction."""
_FAR = 1e6
"""Beyond this [x0, z0] a loop has diverged."""
_INSTRUMENTS = 32
"""Whose numbers are kept, which nobody changes: a comparison linearises many laws on one instrument."""


@lru_cache(maxsize=_INSTRUMENTS)
def nominal_friction(sim: SimParameters) -> _Array:
    """Friction of a flat sample at the setpoint, (3,) [w0^2 x0], against a motion along the reference."""
    p = plant_constants(sim)
    f = plain(bound_of_load)(p["f_s"], 1.0, _static_load(sim, p) / p["L_s"])
    # For a reference that does not move, x stands.
    along = np.array([*sim.reference.velocity, 0.0] if any(sim.reference.velocity) else [1.0, 0.0, 0.0])
    return np.asarray(f * along / np.linalg.norm(along))


def turning_friction(sim: SimParameters) -> _Array:
    """Return friction per velocity around steady sliding (2, 2) [w0]: f/|v| (I - t t'), docs/laws.md (7.1).

    Friction points against the motion and turns with it: across the motion it damps, along it nothing changes. |v| is
    the largest speed of the reference, where this damps least. Zero for a reference that does not move.
    """
    velocity, f = np.array(sim.reference.velocity), np.linalg.norm(nominal_friction(sim))
    if not velocity.any():
        return np.zeros((2, 2))
    speed = np.linalg.norm(velocity)
    along, speed = velocity / speed, speed / (sim.scales.x0 * sim.scales.w0)
    return np.asarray(f / speed * (np.eye(2) - np.outer(along, along)))


def _static_load(sim: SimParameters, p: Any) -> float:
    return float(p["eta_c"] ** 2 * (sim.reference.z_r / sim.scales.z0 - p["a"]) + p["w"])


@lru_cache(maxsize=_INSTRUMENTS)
def plant_matrices(sim: SimParameters, period: float) -> tuple[_Array, _Array, _Array]:
    """Exact step over a control period: nondimensional states from states, from volts, and from friction (8,)."""
    from scipy.linalg import expm  # here: a tenth of a second for nothing in a node

    p = plant_constants(sim)
    F, G = np.zeros((STATES, STATES)), np.zeros((STATES, 3))
    for i, axis in enumerate(AXES):
        eta, xi = p[f"eta_{axis}"], p[f"xi_{axis}"]
        F[2 * i, 2 * i + 1] = 1.0
        F[2 * i + 1, 2 * i : 2 * i + 2] = -eta * eta, -2.0 * xi * eta
        G[2 * i + 1, i] = p[f"gain_{axis}"]
    F[6, 7] = 1.0
    F[7, 6:8] = -(p["eta_c"] ** 2), -2.0 * p["xi_c"] * p["eta_c"]
    u = plain(u_of_load)(_static_load(sim, p) / p["L_s"])
    k = max(p["L_s"] * plain(stiffness_of_u)(u) / p["delta_0"], 0.0)
    c = 2.0 * p["zeta_n"] * math.sqrt(k)
    if contact_of(sim) != SPRING:
        # As good as rigid: far stiffer than either spring, and critically damped.
        k = 1e6 * (p["eta_c"] ** 2 + p["eta_z"] ** 2)
        c = 2.0 * math.sqrt(k)
    # N = k delta + c delta', delta = Z - Q on a flat sample.
    spring = np.array([k, c, -k, -c])
    F[5, 4:8] -= spring / p["mu"]
    F[7, 4:8] += spring
    F[1:4:2, 1:4:2] -= turning_friction(sim)
    f = nominal_friction(sim)
    load = np.array([0.0, -f[0], 0.0, -f[1], 0.0, 0.0, 0.0, 0.0])
    E = expm(np.block([[F, G, load[:, None]], [np.zeros((4, STATES + 4))]]) * sim.scales.w0 * period)
    return E[:STATES, :STATES], E[:STATES, STATES : STATES + 3], E[:STATES, STATES + 3]


@lru_cache(maxsize=_INSTRUMENTS)
def sensors(sim: SimParameters) -> _Array:
    """Measurement [SI] from the plant's states and the drive in force [V]."""
    C = np.zeros((size(Measurement), STATES + 3))
    x0, z0, w0 = sim.scales.x0, sim.scales.z0, sim.scales.w0
    for column in range(STATES + 3):
        y = record_at(C[:, column].copy(), 0, Measurement)
        axis = min(column // 2, 2)
        length = z0 if axis == 2 else x0
        if column < 6:
            target = y.velocity if column % 2 else y.position
            target[axis] = length * (w0 if column % 2 else 1.0)
        elif column == 6:
            y.deflection = z0
            y.deflection_voltage = z0 / sim.detector.deflection_sensitivity
        elif column == 7:
            y.deflection_rate = z0 * w0
        else:
            y.drive[column - STATES] = 1.0
        C[:, column] = np.array([y]).view(np.float64)
    return C


@lru_cache(maxsize=_INSTRUMENTS)
def measurement_at_rest(sim: SimParameters) -> _Array:
    """What is measured with the tip at its setpoint, the reference standing still, without noise."""
    quiet: dict[str, Value] = dict.fromkeys(_NOISES & flatten(sim).keys(), 0.0)
    instrument = Instrument(changed(sim, quiet | {"fault.kind": "none"}), 1, hashed=False)
    y = instrument.measurement.copy()
    record = record_at(y, 0, Measurement)
    record.velocity[:] = record.reference_velocity[:] = record.reference_acceleration[:] = 0.0
    record.drive_sequence = record.newest_drive_sequence = 0
    record.deflection_rate = record.lateral_force = record.lateral_voltage = 0.0
    record.reference_position[:2] = record.position[:2]
    return y


class LinearError(ValueError):
    """A law that has no linear model; the message says why, in one sentence."""


def _ask(law: Controller, y: _Array) -> _Array:
    command = np.zeros(size(PiezoDrive))
    answer(law.block, 0.0, y, command)
    law.raise_errors()
    return command[_VOLTAGE:][:3]


def measurement_sliding(sim: SimParameters, law: Controller, C: _Array) -> _Array:
    """What is measured once the loop has settled against friction; without it, if the loop does not settle.

    A law that is made for no rate settles where it would at any: it is asked at a high one, without delay.
    """
    at_rest = measurement_at_rest(sim)
    sampled = hasattr(law.parameters.law, "period")
    period = sim.plant.control_period if sampled else min(sim.plant.control_period, sim.plant.dt)
    delay = sim.plant.delay_ticks if sampled else 0
    A, B, load = plant_matrices(sim, period)
    force = record_at(y := at_rest.copy(), 0, Measurement)
    force.lateral_force = nominal_friction(sim)[0] * sim.units.lateral_force
    force.lateral_voltage = force.lateral_force / sim.detector.lateral_sensitivity
    flight = np.tile(record_at(at_rest, 0, Measurement).drive, (max(delay, 1), 1))
    law.reset()
    x, command = np.zeros(STATES + 3), np.zeros(size(PiezoDrive))
    settled = _settle(
        law.block, command, y, C, np.ascontiguousarray(A), np.ascontiguousarray(B), load, flight, delay, x
    )
    law.raise_errors()
    return y + C @ x if settled else at_rest.copy()


@routine
def _settle(
    law: Block,
    command: _Array,
    y: _Array,
    C: _Array,
    A: _Array,
    B: _Array,
    load: _Array,
    flight: _Array,
    delay: int,
    x: _Array,
) -> bool:
    """Let the loop run for _SETTLING control periods; x: states and drive at the end. Whether they move no more."""
    start, last, moved, due = flight[0].copy(), np.zeros(STATES), np.zeros(STATES), np.zeros(3)
    n, seen = len(flight), np.zeros(len(y))
    for k in range(_SETTLING):
        np.dot(C, x, seen)
        for i in range(len(y)):
            seen[i] += y[i]
        answer(law, 0.0, seen, command)
        for axis in range(3):
            given = command[_VOLTAGE + axis]
            due[axis] = (flight[k % n, axis] if delay else given) - start[axis]
            flight[k % n, axis] = given
        last[:] = x[:STATES]
        np.dot(A, last, moved)
        np.dot(B, due, x[:STATES])
        far = 0.0
        for i in range(STATES):
            x[i] = moved[i] + x[i] + load[i]
            far = max(far, abs(x[i])) if x[i] == x[i] else _FAR
        x[STATES:] = due
        if not far < _FAR:
            return False
    return bool(np.max(np.abs(x[:STATES] - last)) < _SMALL)


def law_scales(law: Controller, sliding: _Array, C: _Array) -> tuple[_Array, _Array]:
    """How far each number of the law's state and each measured one is changed; leaves the law settled."""
    inputs = _SMALL * np.max(np.abs(C), axis=1)
    width = size(find("law", law.parameters.law.kind).state)
    at = len(law.block) - width
    tail = law.block[at:]
    integers = _integers(law)
    random = np.random.default_rng(0)
    # An integral goes on while the loop is open: it keeps what it came to.
    begin = tail.copy()
    shown = np.vstack([np.tile(sliding, (_TICKS, 1)), sliding + inputs * random.uniform(-1.0, 1.0, (_TICKS, len(C)))])
    largest = np.zeros(width)
    _shake(law.block, at, np.zeros(size(PiezoDrive)), shown, _TICKS, integers, largest)
    law.raise_errors()
    tail[:] = begin
    before = tail.copy()
    _ask(law, sliding)
    if np.any(before.view(np.int64)[integers] != tail.view(np.int64)[integers]):
        raise LinearError(f"law {law.parameters.law.kind} counts its ticks: it has no linear model that stays the same")
    return np.where(np.isfinite(largest), largest, 0.0), inputs


@routine
def _shake(
    law: Block,
    at: int,
    command: _Array,
    shown: _Array,
    settling: int,
    integers: NDArray[np.bool_],
    largest: _Array,
) -> None:
    """Show measurements to a law; `largest`: how far the numbers of its state, from law[at] on, go after the first
    `settling` of them, whole numbers left out.
    """
    settled = law[at:].copy()
    for k in range(len(shown)):
        answer(law, 0.0, shown[k], command)
        if k < settling:
            settled[:] = law[at:]
            continue
        for i in range(len(largest)):
            way = abs(law[at + i] - settled[i])
            if not integers[i] and (way > largest[i] or math.isnan(way)):
                largest[i] = way


def _integers(law: Controller) -> NDArray[np.bool_]:
    """Which numbers of the law's state are whole numbers: those are not changed by a little."""
    state: type[Record] = find("law", law.parameters.law.kind).state
    flags = [np.full(shape, kind is np.int64).ravel() for kind, shape, _ in state.fields.values()]
    return np.concatenate([np.zeros(0, bool), *flags])


def jacobian(law: Controller, sliding: _Array, states: _Array, inputs: _Array) -> tuple[_Array, _Array]:
    """(state after, drive [V]) per change of the state before, and per change of the measurement."""
    n = len(states)
    at = len(law.block) - n
    command, integers = np.zeros(size(PiezoDrive)), _integers(law)
    weights = np.concatenate([states, inputs])

    def slopes(factor: float) -> _Array:
        found = np.zeros((n + 3, len(weights)))
        _slopes(law.block, at, command, sliding, factor * weights, integers, found)
        law.raise_errors()
        return found

    one, other = slopes(1.0), slopes(0.3)
    # In units of the changes, so that all rows and columns compare.
    difference, whole = np.abs(one - other) * weights, np.abs(one) * weights
    rows = np.max(whole, axis=1, keepdims=True)
    if np.any(difference > 0.02 * np.where(rows > 0.0, rows, 1.0)):
        raise LinearError(
            f"law {law.parameters.law.kind} switches: its answer to a small change is not proportional to it"
        )
    return one[:, :n], one[:, n:]


@routine
def _slopes(
    law: Block, at: int, command: _Array, y: _Array, steps: _Array, integers: NDArray[np.bool_], found: _Array
) -> None:
    """Find the derivatives of the state from law[at] on, and of the drive, after a measurement y, by the state before
    and by y: central differences by `steps`, (state and drive, steps). Leaves the law as it was.
    """
    n = len(integers)
    settled, seen = law[at:].copy(), y.copy()
    for i in range(len(steps)):
        if not steps[i] > 0.0:
            continue
        for turn in range(2):
            step = -steps[i] if turn else steps[i]
            law[at:] = settled
            command[_VOLTAGE : _VOLTAGE + 3] = 0.0
            if i < n:
                law[at + i] += step
            else:
                seen[i - n] = y[i - n] + step
            answer(law, 0.0, seen, command)
            if i >= n:
                seen[i - n] = y[i - n]
            for row in range(n + 3):
                after = command[_VOLTAGE + row - n] if row >= n else 0.0 if integers[row] else law[at + row]
                found[row, i] = (found[row, i] - after) / (2.0 * steps[i]) if turn else after
    law[at:] = settled
