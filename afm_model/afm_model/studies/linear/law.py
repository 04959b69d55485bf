"""A law, linearised: what it answers to small changes of what it has measured and of what it remembers."""

import numpy as np
from numpy.typing import NDArray

from ...core.records import Record, place, record_at, size
from ...core.registry import find
from ...instrument.controller import Controller, answer
from ...parameters import SimParameters
from ...parts.signals import Measurement, PiezoDrive
from .plant import STATES, measurement_at_rest, nominal_friction, plant_matrices

_Array = NDArray[np.float64]
_SMALL = 1e-5
"""Change by which the law is probed, in the paper's units."""
_TICKS = 200
"""Measurements after which a law has settled at what it is shown."""
_SETTLING = 4000
"""Control periods in which a stable loop comes to rest against friction."""
_FAR = 1e6
"""Beyond this [x0, z0] a loop has diverged."""


class LinearError(ValueError):
    """A law that has no linear model; the message says why, in one sentence."""


def _ask(law: Controller, y: _Array) -> _Array:
    command = np.zeros(size(PiezoDrive))
    answer(law.block, 0.0, y, command)
    law.raise_errors()
    return command[place(PiezoDrive, "voltage") :][:3]


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
    start = record_at(at_rest, 0, Measurement).drive.copy()
    flight = [start] * (delay + 1)
    x, last = np.zeros(STATES + 3), np.zeros(STATES)
    law.reset()
    for _ in range(_SETTLING):
        flight.append(_ask(law, y + C @ x).copy())
        due = flight.pop(0) if delay else flight.pop()
        last, x[:STATES] = x[:STATES].copy(), A @ x[:STATES] + B @ (due - start) + load
        x[STATES:] = due - start
        if not np.max(np.abs(x[:STATES])) < _FAR:
            return at_rest
    return y + C @ x if np.max(np.abs(x[:STATES] - last)) < _SMALL else at_rest


def law_scales(law: Controller, sliding: _Array, C: _Array) -> tuple[_Array, _Array]:
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
    state: type[Record] = find("law", law.parameters.law.kind).state
    flags = [np.full(shape, kind is np.int64).ravel() for kind, shape, _ in state.fields.values()]
    return np.concatenate([np.zeros(0, bool), *flags])


def jacobian(law: Controller, sliding: _Array, states: _Array, inputs: _Array) -> tuple[_Array, _Array]:
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
