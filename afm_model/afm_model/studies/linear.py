"""The closed loop of any law, linearised: is it stable at this rate and delay, and with what margin?

The scanner slides steadily along the reference over a flat sample, the tip near its setpoint. Friction is constant
along this motion and damps across it, since it turns with the velocity; the contact is a spring with a dashpot. The law
is asked what it answers to small changes. docs/laws.md, section 7.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled.records import size
from ..core.errors import ParameterError
from ..core.registry import find
from ..instrument.controller import Controller
from ..law import ContactWarning
from ..parameters import ControllerParameters, SimParameters, changed, flatten
from ..plant.steps import contact_of
from .linear_model import AXES, STATES, LinearError, jacobian, law_scales, measurement_sliding, plant_matrices, sensors

_Array = NDArray[np.float64]
_NOTHING = 1e-9
_FREQUENCIES = 2000
_NEAR = 1e-3
"""ln of a distance from -1: so near to the smallest one it is computed exactly."""
STABLE = 1.0 + 1e-7
"""Spectral radius up to which a loop counts as stable: a law may hold a number for ever."""


@dataclass(frozen=True)
class LoopCut:
    """The loop cut between drive and piezo of one axis, the others closed: x(k+1) = A x + B u, y = C x + D u."""

    A: _Array
    B: _Array
    C: _Array
    D: _Array


class Margins(NamedTuple):
    """How far a stable loop is from the limit."""

    gain: float  # factor by which the drive may act more strongly
    phase: float  # in either direction [degrees]
    delay: float  # further delay [s]
    distance: float  # smallest distance from -1


@dataclass(frozen=True)
class LinearLoop:
    """A linearised closed loop, sampled at the control ticks."""

    period: float  # [s]
    delay_ticks: int
    matrix: _Array  # x(k+1) = matrix x(k)
    radius: float  # spectral radius; above 1 the loop diverges
    axis: str  # along which its slowest or fastest growing motion is largest
    cuts: dict[str, LoopCut]  # by axis

    @property
    def stable(self) -> bool:
        """Whether every motion decays."""
        return self.radius <= STABLE

    def control_system(self, axis: str) -> Any:
        """The loop cut between drive and piezo of `axis` as a `control.StateSpace` of python-control.

        Raises
        ------
        ImportError
            If python-control is not installed: pip install control.
        """
        import control

        cut = self.cuts[axis]
        return control.ss(cut.A, cut.B, cut.C, cut.D, self.period)

    def margins(self, axis: str) -> Margins:
        """Margins of the loop cut between drive and piezo of `axis`, by python-control.

        Raises
        ------
        ImportError
            If python-control is not installed: pip install control.
        """
        import control

        # From the response: a transfer function of so many states has no digits left.
        omega = np.pi / self.period * np.geomspace(1e-4, 1.0 - 1e-9, _FREQUENCIES)
        response = self.response(axis, omega)
        system = control.frd(response, omega, smooth=True)
        gains, phases, _, _, crossings, _ = control.stability_margins(system, returnall=True)
        turns = np.radians(np.mod(phases, 360.0))
        return Margins(
            gain=float(min((each for each in gains if each > 1.0), default=np.inf)),
            phase=float(min(np.minimum(np.mod(phases, 360.0), np.mod(-phases, 360.0)), default=np.inf)),
            delay=float(min(turns / crossings, default=np.inf)),
            distance=float(np.min(np.abs(1.0 + response))),
        )

    def distance(self, omega: _Array) -> float:
        """Smallest distance of the open loop from -1 at omega [rad/s], over all axes.

        1 + L is det(z - closed loop) over det(z - loop cut): their roots show where it is small, and there alone the
        response is asked for.
        """
        z = np.exp(1j * omega * self.period)
        with np.errstate(divide="ignore", invalid="ignore"):
            closed = _logarithm(self.matrix, z)
            found = {axis: closed - _logarithm(cut.A, z) for axis, cut in self.cuts.items()}
            least = min(np.min(each) for each in found.values())
            places = {axis: np.flatnonzero(~(each > least + _NEAR)) for axis, each in found.items()}
        near = {axis: np.abs(1.0 + self.response(axis, omega[at])) for axis, at in places.items() if len(at)}
        off = max(np.max(np.abs(np.log(each) - found[axis][places[axis]])) for axis, each in near.items())
        if not off < 0.5 * _NEAR:
            # Roots of loops with many equal ones are not exact.
            near = {axis: np.abs(1.0 + self.response(axis, omega)) for axis in self.cuts}
        return float(min(np.min(each) for each in near.values()))

    def response(self, axis: str, omega: _Array) -> NDArray[np.complex128]:
        """Frequency response of the loop cut between drive and piezo of `axis`, at omega [rad/s]."""
        cut = self.cuts[axis]
        matrices = np.tile(-cut.A.astype(np.complex128), (len(omega), 1, 1))
        i = np.arange(len(cut.A))
        matrices[:, i, i] += np.exp(1j * omega * self.period)[:, None]
        found = cut.C @ np.linalg.solve(matrices, cut.B) + cut.D
        return np.asarray(found, np.complex128).reshape(-1)


def _logarithm(matrix: _Array, z: NDArray[np.complex128]) -> _Array:
    """ln |det(z - matrix)| at each z."""
    roots = np.linalg.eigvals(matrix)
    return np.asarray(np.sum(np.log(np.abs(z[:, None] - roots)), axis=1))


def inside_drives_z(sim: SimParameters) -> bool:
    """Whether a loop inside the instrument drives z, whatever the law answers along z."""
    loop = sim.onboard
    return find("onboard", loop.kind).moves_z and getattr(loop, "feedback", "on") != "external"


LARGEST = 500
"""Numbers of state beyond which a linear model takes more time and memory than it is worth."""


def linearise(sim: SimParameters, controller: ControllerParameters) -> LinearLoop:
    """Linear model of a law on an instrument.

    Parameters
    ----------
    sim : SimParameters
        Plant, control period and delay. Noise and faults do not count, sensors and piezo are taken as ideal; a plant
        whose contact is not declared as a spring is taken to hold the tip on the sample. A loop inside the instrument
        that drives z is taken to hold it: what the law answers along z has no effect then.
    controller : ControllerParameters

    Raises
    ------
    LinearError
        If the law switches or counts, so that small changes have no proportional answer; if law and delay have more
        than LARGEST numbers of state.
    ParameterError, PartError
        If law or instrument cannot be made.
    """
    own = size(find("law", controller.law.kind).state)
    if own + 3 * sim.plant.delay_ticks > LARGEST:
        raise LinearError(
            f"law {controller.law.kind} with {own} numbers of state and plant.delay_ticks = {sim.plant.delay_ticks} "
            f"has no linear model that can be handled: {LARGEST} numbers are the most"
        )
    if not contact_of(sim):
        warnings.warn(
            f"plant.kind = {sim.plant.kind} does not declare its contact: the linear model holds the tip on the sample "
            f"(docs/extending.md)",
            ContactWarning,
            stacklevel=2,
        )
    law, C = Controller(controller), sensors(sim)
    A, B, _ = plant_matrices(sim, sim.plant.control_period)
    sliding = measurement_sliding(sim, law, C)
    states, inputs = law_scales(law, sliding, C)
    from_state, from_input = jacobian(law, sliding, states, inputs)
    n, d = len(states), sim.plant.delay_ticks
    total = STATES + 3 + 3 * d + n
    in_force = np.array([1.0, 1.0, 0.0 if inside_drives_z(sim) else 1.0])
    line, own = STATES + 3, STATES + 3 + 3 * d
    # What the law answers, and which drive is due, per number of the state.
    reply = np.zeros((n + 3, total))
    for column in range(line):
        reply[:, column] = from_input @ C[:, column].copy()
    reply[:, own:] = from_state
    u = reply[n:] * in_force[:, None]
    due = np.eye(3, total, line) if d else u

    def tick(cut: int = -1) -> _Array:
        """A control tick; the plant feels nothing along the axis `cut`."""
        after = np.zeros((total, total))
        felt = due.copy()
        if cut >= 0:
            felt[cut] = 0.0
        for column in range(total):
            after[:STATES, column] = B @ felt[:, column].copy()
        after[:STATES, :STATES] += A
        after[STATES:line] = due
        if d:
            after[line : own - 3, line + 3 : own] = np.eye(3 * d - 3)
            after[own - 3 : own] = u
        after[own:] = reply[:n]
        return after

    matrix = tick()
    cuts = {}
    for i, axis in enumerate(AXES):
        into = np.zeros((total, 1))
        into[:STATES, 0] = B[:, i]
        cuts[axis] = LoopCut(tick(i), into, -due[i : i + 1], np.zeros((1, 1)))
    values, vectors = np.linalg.eig(matrix)
    # What a law remembers and does not use moves nothing.
    moving = np.max(np.abs(vectors[:STATES]), axis=0) > _NOTHING
    worst = int(np.argmax(np.where(moving, np.abs(values), 0.0)))
    motion = np.abs(vectors[:STATES, worst])
    largest = [np.max(motion[0:2]), np.max(motion[2:4]), np.max(motion[4:8])]
    axis = AXES[int(np.argmax(largest))]
    return LinearLoop(sim.plant.control_period, d, matrix, float(np.abs(values[worst])), axis, cuts)


def at_timing(
    sim: SimParameters, controller: ControllerParameters, period: float, delay_ticks: int
) -> tuple[SimParameters, ControllerParameters]:
    """Instrument and law at another control period and delay; a law that is made for them is made for the new ones.

    Raises
    ------
    ParameterError
        If the instrument cannot have this period.
    """
    timing = {"law.period": period, "law.delay_ticks": delay_ticks}
    known = {name: value for name, value in timing.items() if name in flatten(controller)}
    return changed(sim, {"plant.control_period": period, "plant.delay_ticks": delay_ticks}), changed(controller, known)


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
