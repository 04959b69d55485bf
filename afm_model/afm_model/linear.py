"""The closed loop of any law, linearised: is it stable at this rate and delay, and with what margin?

The scanner slides steadily along the reference, so that friction is a constant, over a flat sample, the tip near its
setpoint; the contact is a spring with a dashpot. The law is asked what it answers to small changes. docs/laws.md,
section 7.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from .contact.jkr import stiffness_of_u, u_of_load
from .controller import Controller, answer
from .errors import ParameterError
from .friction.strength import bound_of_load
from .instrument import Instrument
from .jit import plain
from .parameters import ControllerParameters, SimParameters, Value, build, flatten
from .plant.constants import plant_constants
from .records import place, record_at, size
from .registry import find
from .signals import COMMAND, MEASUREMENT

_Array = NDArray[np.float64]
AXES = ("x", "y", "z")
_PLANT = 8
"""States of the plant: X, V_X, Y, V_Y, Z, V_Z, Q, V_Q."""
_SMALL = 1e-5
"""Change by which the law is probed, in the paper's units."""
_TICKS = 200
"""Measurements after which a law has settled at what it is shown."""
_SETTLING = 4000
"""Control periods in which a stable loop comes to rest against friction."""
_NOTHING = 1e-9
_FAR = 1e6
"""Beyond this [x0, z0] a loop has diverged."""
STABLE = 1.0 + 1e-7
"""Spectral radius up to which a loop counts as stable: a law may hold a number for ever."""


class LinearError(ValueError):
    """A law that has no linear model; the message says why, in one sentence."""


@dataclass(frozen=True)
class Cut:
    """The loop cut at the drive of one axis, the others closed: x(k+1) = A x + B u, y = C x + D u."""

    A: _Array
    B: _Array
    C: _Array
    D: _Array


@dataclass(frozen=True)
class LinearLoop:
    """A linearised closed loop, sampled at the control ticks."""

    period: float  # [s]
    delay_ticks: int
    matrix: _Array  # x(k+1) = matrix x(k)
    radius: float  # spectral radius; above 1 the loop diverges
    axis: str  # along which its slowest or fastest growing motion is largest
    cuts: dict[str, Cut]  # by axis

    @property
    def stable(self) -> bool:
        """Whether every motion decays."""
        return self.radius <= STABLE

    def response(self, axis: str, omega: _Array) -> NDArray[np.complex128]:
        """Frequency response of the loop cut at the drive of `axis`, at omega [rad/s]; -1 is the critical point."""
        cut = self.cuts[axis]
        identity = np.eye(len(cut.A))
        z = np.exp(1j * omega * self.period)
        return np.array([(cut.C @ np.linalg.solve(each * identity - cut.A, cut.B) + cut.D).item() for each in z])


def linearise(sim: SimParameters, controller: ControllerParameters) -> LinearLoop:
    """Linear model of a law on an instrument.

    Parameters
    ----------
    sim : SimParameters
        Plant, control period and delay. Noise and faults do not count; other plants than `compliant` are taken to hold
        the tip on the sample.
    controller : ControllerParameters

    Returns
    -------
    LinearLoop

    Raises
    ------
    LinearError
        If the law switches or counts, so that small changes have no proportional answer.
    ParameterError, PartError
        If law or instrument cannot be made.
    """
    law, C = Controller(controller), _sensors(sim)
    A, B, _ = _plant_matrices(sim, sim.plant.control_period)
    sliding = _measurement_sliding(sim, law, C)
    states, inputs = _law_scales(law, sliding, C)
    from_state, from_input = _jacobian(law, sliding, states, inputs)
    n, d = len(states), sim.plant.delay_ticks
    total = _PLANT + 3 + 3 * d + n
    line, own = _PLANT + 3, _PLANT + 3 + 3 * d

    def tick(x: _Array, cut: int = -1, given: float = 0.0) -> tuple[_Array, float]:
        """One control tick; at the axis `cut` the drive is `given` in place of the law's, which is returned."""
        y = C @ x[:line]
        reply = from_state @ x[own:] + from_input @ y
        u = reply[n:].copy()
        answered = 0.0
        if cut >= 0:
            answered, u[cut] = float(u[cut]), given
        due = x[line : line + 3] if d else u
        after = np.empty(total)
        after[:_PLANT] = A @ x[:_PLANT] + B @ due
        after[_PLANT:line] = due
        if d:
            after[line:own] = np.concatenate([x[line + 3 : own], u])
        after[own:] = reply[:n]
        return after, answered

    identity = np.eye(total)
    matrix = np.column_stack([tick(column)[0] for column in identity])
    cuts = {}
    for i, axis in enumerate(AXES):
        columns = [tick(column, i) for column in identity]
        into = tick(np.zeros(total), i, 1.0)[0]
        out = np.array([[-answered for _, answered in columns]])
        cuts[axis] = Cut(np.column_stack([after for after, _ in columns]), into[:, None], out, np.zeros((1, 1)))
    values, vectors = np.linalg.eig(matrix)
    # What a law remembers and does not use moves nothing.
    moving = np.max(np.abs(vectors[:_PLANT]), axis=0) > _NOTHING
    worst = int(np.argmax(np.where(moving, np.abs(values), 0.0)))
    motion = np.abs(vectors[:_PLANT, worst])
    largest = [np.max(motion[0:2]), np.max(motion[2:4]), np.max(motion[4:8])]
    axis = AXES[int(np.argmax(largest))]
    return LinearLoop(sim.plant.control_period, d, matrix, float(np.abs(values[worst])), axis, cuts)


def nominal_friction(sim: SimParameters) -> _Array:
    """Friction of a flat sample at the setpoint, (3,) [w0^2 x0], against a motion along the reference."""
    p = plant_constants(sim)
    f = plain(bound_of_load)(p["f_s"], 1.0, _static_load(sim, p) / p["L_s"])
    # A part of the reference that has no amplitude does not move; of one that has none at all, x stands for it.
    along = np.abs([*sim.reference.amplitude, 0.0]) if any(sim.reference.amplitude) else np.array([1.0, 0.0, 0.0])
    return np.asarray(f * along / np.linalg.norm(along))


def _static_load(sim: SimParameters, p: Any) -> float:
    return float(p["eta_c"] ** 2 * (sim.reference.z_r / sim.scales.z0 - p["a"]) + p["w"])


def _plant_matrices(sim: SimParameters, period: float) -> tuple[_Array, _Array, _Array]:
    """Exact step over a control period: nondimensional states from states, from volts, and from friction (8,)."""
    p = plant_constants(sim)
    F, G = np.zeros((_PLANT, _PLANT)), np.zeros((_PLANT, 3))
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
    if sim.plant.kind != "compliant":
        # As good as rigid: far stiffer than either spring, and critically damped.
        k = 1e6 * (p["eta_c"] ** 2 + p["eta_z"] ** 2)
        c = 2.0 * math.sqrt(k)
    # N = k delta + c delta', delta = Z - Q on a flat sample.
    spring = np.array([k, c, -k, -c])
    F[5, 4:8] -= spring / p["mu"]
    F[7, 4:8] += spring
    f = nominal_friction(sim)
    load = np.array([0.0, -f[0], 0.0, -f[1], 0.0, 0.0, 0.0, 0.0])
    E = expm(np.block([[F, G, load[:, None]], [np.zeros((4, _PLANT + 4))]]) * sim.scales.w0 * period)
    return E[:_PLANT, :_PLANT], E[:_PLANT, _PLANT : _PLANT + 3], E[:_PLANT, _PLANT + 3]


def _sensors(sim: SimParameters) -> _Array:
    """Measurement [SI] from the plant's states and the drive in force [V]."""
    C = np.zeros((size(MEASUREMENT), _PLANT + 3))
    x0, z0, w0 = sim.scales.x0, sim.scales.z0, sim.scales.w0
    for column in range(_PLANT + 3):
        y = record_at(C[:, column].copy(), 0, MEASUREMENT)
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
            y.drive[column - _PLANT] = 1.0
        C[:, column] = np.array([y]).view(np.float64)
    return C


def _measurement_at_rest(sim: SimParameters) -> _Array:
    """What is measured with the tip at its setpoint, the reference standing still, without noise."""
    quiet: dict[str, Value] = {"detector.noise": 0.0, "detector.position_noise": 0.0, "fault.kind": "none"}
    given = {name: value for name, value in flatten(sim).items() if not name.startswith("fault.")}
    known = {name: value for name, value in quiet.items() if name in given or name == "fault.kind"}
    instrument = Instrument(build(SimParameters, given | known), 1, hashed=False)
    y = instrument.measurement.copy()
    record = record_at(y, 0, MEASUREMENT)
    record.velocity[:] = record.reference_velocity[:] = record.reference_acceleration[:] = 0.0
    record.drive_sequence = record.newest_drive_sequence = 0
    record.deflection_rate = record.lateral_force = record.lateral_voltage = 0.0
    record.reference_position[:2] = record.position[:2]
    return y


def _measurement_sliding(sim: SimParameters, law: Controller, C: _Array) -> _Array:
    """What is measured once the loop has settled against friction; without it, if the loop does not settle.

    A law that is made for no rate settles where it would at any: it is asked at a high one, without delay.
    """
    at_rest = _measurement_at_rest(sim)
    sampled = hasattr(law.parameters.law, "period")
    period = sim.plant.control_period if sampled else min(sim.plant.control_period, sim.plant.dt)
    delay = sim.plant.delay_ticks if sampled else 0
    A, B, load = _plant_matrices(sim, period)
    force = record_at(y := at_rest.copy(), 0, MEASUREMENT)
    force.lateral_force = nominal_friction(sim)[0] * sim.units.lateral_force
    force.lateral_voltage = force.lateral_force / sim.detector.lateral_sensitivity
    start = record_at(at_rest, 0, MEASUREMENT).drive.copy()
    flight = [start] * (delay + 1)
    x, last = np.zeros(_PLANT + 3), np.zeros(_PLANT)
    law.reset()
    for _ in range(_SETTLING):
        flight.append(_ask(law, y + C @ x).copy())
        due = flight.pop(0) if delay else flight.pop()
        last, x[:_PLANT] = x[:_PLANT].copy(), A @ x[:_PLANT] + B @ (due - start) + load
        x[_PLANT:] = due - start
        if not np.max(np.abs(x[:_PLANT])) < _FAR:
            return at_rest
    return y + C @ x if np.max(np.abs(x[:_PLANT] - last)) < _SMALL else at_rest


def _ask(law: Controller, y: _Array) -> _Array:
    command = np.zeros(size(COMMAND))
    answer(law.block, 0.0, y, command)
    law.raise_errors()
    return command[place(COMMAND, "voltage") :][:3]


def _law_scales(law: Controller, sliding: _Array, C: _Array) -> tuple[_Array, _Array]:
    """How far each number of the law's state and each measured one is changed; leaves the law settled."""
    inputs = _SMALL * np.max(np.abs(C), axis=1)
    width = size(find("law", law.parameters.law.kind).state)
    tail = law.block[len(law.block) - width :]
    integers = _integers(law)
    random = np.random.default_rng(0)
    # An integral goes on while the loop is open: it keeps what it came to.
    begin = tail.copy()
    for _ in range(_TICKS):
        _ask(law, sliding)
    settled = tail.copy()
    largest = np.zeros(width)
    for _ in range(_TICKS):
        _ask(law, sliding + inputs * random.uniform(-1.0, 1.0, len(inputs)))
        largest = np.maximum(largest, np.abs(np.where(integers, 0.0, tail - np.where(integers, 0.0, settled))))
    tail[:] = begin
    before = tail.copy()
    _ask(law, sliding)
    if np.any(before.view(np.int64)[integers] != tail.view(np.int64)[integers]):
        raise LinearError(f"law {law.parameters.law.kind} counts its ticks: it has no linear model that stays the same")
    return np.where(np.isfinite(largest), largest, 0.0), inputs


def _integers(law: Controller) -> NDArray[np.bool_]:
    """Which numbers of the law's state are whole numbers: those are not changed by a little."""
    dtype: Any = find("law", law.parameters.law.kind).state
    flags = np.zeros(size(dtype), bool)
    for name in dtype.names or ():
        kind, offset = dtype.fields[name][:2]
        flags[offset // 8 : (offset + kind.itemsize) // 8] = kind.base.kind == "i"
    return flags


def _jacobian(law: Controller, sliding: _Array, states: _Array, inputs: _Array) -> tuple[_Array, _Array]:
    """(state after, drive [V]) per change of the state before, and per change of the measurement."""
    n = len(states)
    tail = law.block[len(law.block) - n :]
    settled = tail.copy()

    def reply(change: _Array, y: _Array) -> _Array:
        tail[:] = settled
        moved = change != 0.0
        tail[moved] += change[moved]
        drive = _ask(law, y)
        after = np.where(_integers(law), 0.0, tail)
        return np.concatenate([after, drive])

    def slopes(factor: float) -> _Array:
        columns = []
        for i, step in enumerate(factor * np.concatenate([states, inputs])):
            change, y = np.zeros(n), np.zeros(len(inputs))
            (change if i < n else y)[i if i < n else i - n] = step
            columns.append(
                (reply(change, sliding + y) - reply(-change, sliding - y)) / (2.0 * step)
                if step > 0.0
                else np.zeros(n + 3)
            )
        return np.column_stack(columns)

    one, other = slopes(1.0), slopes(0.3)
    tail[:] = settled
    # In units of the changes, so that all rows and columns compare.
    weights = np.concatenate([states, inputs])
    difference, whole = np.abs(one - other) * weights, np.abs(one) * weights
    rows = np.max(whole, axis=1, keepdims=True)
    if np.any(difference > 0.02 * np.where(rows > 0.0, rows, 1.0)):
        raise LinearError(
            f"law {law.parameters.law.kind} switches: its answer to a small change is not proportional to it"
        )
    return one[:, :n], one[:, n:]


def at_timing(sim: SimParameters, controller: ControllerParameters, period: float, delay_ticks: int) -> Any:
    """Instrument and law at another control period and delay; a law that is made for them is made for the new ones.

    Raises
    ------
    ParameterError
        If the instrument cannot have this period.
    """
    plant = {"plant.control_period": period, "plant.delay_ticks": delay_ticks}
    own = flatten(controller)
    timing = {"law.period": period, "law.delay_ticks": delay_ticks}
    known = {name: value for name, value in timing.items() if name in own}
    return build(type(sim), flatten(sim) | plant), build(type(controller), own | known)


def is_stable(sim: SimParameters, controller: ControllerParameters, period: float, delay_ticks: int) -> bool:
    """Whether the linearised loop is stable at another control period and delay."""
    try:
        return linearise(*at_timing(sim, controller, period, delay_ticks)).stable
    except (ParameterError, ArithmeticError, np.linalg.LinAlgError):
        return False


def largest(holds: Callable[[int], bool], highest: int) -> int:
    """Largest whole number in 0 ... highest up to which `holds` is true, if it is so up to some; -1: nowhere."""
    low, high = -1, highest + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
