"""The loop of `predictive` as it is closed, filter included, over a period of the reference: docs/predictive.md.

The code itself is linearised: instrument and law run until the filter has settled, a number of their state is changed
by a little, and both go on for a period. What is left of the change is a column of the matrix whose eigenvalues
are the multipliers of Floquet: what a deviation grows by from period to period.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from afm_model import Controller, ControllerParameters, Instrument, SimParameters, build

_Array = NDArray[np.float64]
OMEGAS = (45.0, 50.0, 55.0, 60.0)
"""Of the reference [rad/s], about: a period is a whole number of control periods."""
FORETOLD = 1e-2
"""Of a deviation, what the matrix may be wrong by. It is more where one passes by a corner, such as the speed that is
rest: there the loop has no matrix.
"""
SETTLING = 6
"""Periods until the gains of the filter repeat themselves."""
PLANT = ("X", "V_X", "Y", "V_Y")
STEPS = {"X": 1e-6, "V_X": 1e-8, "Y": 1e-6, "V_Y": 1e-8, "gain": 1e-6, "slow force": 1e-5, "stiffness": 1e-6}
"""By how much each number is changed: [x0], [x0 w0], 1, [w0^2 x0], [w0^2]. Of the filter first those of x.

The openings of the hysteresis and creep are none of them: where there are none they stand at their limit, zero.
"""
ESTIMATES = ("gain", "slow force", "stiffness")
"""The first of `learned` of each axis."""


class Loop:
    """Instrument and law in a state to which they can return.

    Parameters
    ----------
    period : float [s]
    delay : int
        Control periods that the law is told.
    late : int
        Further ones that it is not told.
    packet : int
        Drives in an answer.
    omega : float [rad/s]
        Of the reference.
    law
        Further parameters of the law.
    """

    def __init__(
        self, period: float, delay: int, late: int = 0, packet: int = 1, omega: float = 55.0, **law: Any
    ) -> None:
        self.ticks = round(2.0 * math.pi / omega / period)
        omega = 2.0 * math.pi / (self.ticks * period)
        sim: dict[str, Any] = {"plant.control_period": period, "plant.delay_ticks": delay + late}
        sim |= {f"reference.omega_{axis}": omega for axis in "xy"}
        told: dict[str, Any] = {"law.kind": "predictive", "law.period": period, "law.delay_ticks": delay}
        told |= {"law.delay": "nominal"}  # otherwise it finds the delay, and none of its drives is late
        if packet > 1:
            sim["piezo.dac_period"] = period / packet
            told |= {"law.packet": packet, "law.spare": 1}
        self.scope = Instrument(build(SimParameters, sim), self.ticks, hashed=False, sampled=False)
        self.law = Controller(build(ControllerParameters, told | {f"law.{name}": value for name, value in law.items()}))
        # Off the turn of the reference, where the tip rests.
        self.run(self.ticks // 8)
        for _ in range(SETTLING):
            self.run(self.ticks)
        self._kept = [each.copy() for each in self._arrays()]
        self._at = self.scope.ticks

    def _arrays(self) -> list[_Array]:
        return [self.scope._block, self.law.block, self.law._memory]

    def run(self, ticks: int) -> None:
        """Close the loop for so many ticks."""
        while ticks > 0:
            self.scope.close_loop(self.law, min(ticks, self.ticks))
            self.scope.skip_block()
            ticks -= self.ticks

    def back(self) -> None:
        """Return to where the filter had settled."""
        for array, kept in zip(self._arrays(), self._kept, strict=True):
            array[:] = kept
        self.scope.ticks = self._at

    def read(self) -> _Array:
        """Position and rate of x and y, then the six numbers of the filter, over their steps (10,)."""
        plant, law = self.scope.record("plant_state"), self.law.state
        moved = [plant[name] / STEPS[name] for name in PLANT]
        found = [law["learned"][axis][i] / STEPS[name] for axis in range(2) for i, name in enumerate(ESTIMATES)]
        return np.array(moved + found)

    def change(self, number: int, steps: float) -> None:
        """Change one of those."""
        if number < len(PLANT):
            self.scope.record("plant_state")[PLANT[number]] += steps * STEPS[PLANT[number]]
        else:
            axis, which = divmod(number - len(PLANT), len(ESTIMATES))
            self.law.state["learned"][axis][which] += steps * STEPS[ESTIMATES[which]]

    def left(self, change: _Array, ticks: int) -> _Array:
        """What is left of a change (10,) after so many ticks, by central differences."""
        ends = []
        for sign in (1.0, -1.0):
            self.back()
            for number in np.flatnonzero(change):
                self.change(int(number), sign * float(change[number]))
            self.run(ticks)
            ends.append(self.read())
        return (ends[0] - ends[1]) / 2.0

    def matrix(self) -> _Array:
        """What a period makes of each of the numbers (10, 10)."""
        return np.column_stack([self.left(column, self.ticks) for column in np.eye(10)])


def multiplier(loop: Loop) -> float:
    """Largest modulus of the eigenvalues of the matrix; NaN where it does not foretell what is left of a deviation."""
    matrix = loop.matrix()
    change = np.concatenate([np.zeros(len(PLANT)), [1.0, -2.0, 1.5, 0.5, 1.0, -1.0]])
    left = loop.left(change, loop.ticks)
    if np.abs(left - matrix @ change).max() > FORETOLD * np.abs(left).max():
        return math.nan
    return float(max(abs(np.linalg.eigvals(matrix))))


def table() -> str:
    """Of the rates of the table of wrong models, with the surface known; the largest of a few references.

    The piezo is believed to have no memory: where it has none its openings and creep stand at a limit, a corner.
    """
    memory = {"hysteresis": "none", "creep": "none"}
    lines = ["| period + delay | drives as told | one period later |", "| --- | --- | --- |"]
    for title, period, packet in (("50 us + 1", 5e-5, 1), ("200 us + 1", 2e-4, 1), ("1 ms + 1, packets", 1e-3, 20)):
        cells = []
        for late in (0, 1):
            found = [multiplier(Loop(period, 1, late, packet, omega, surface="known", **memory)) for omega in OMEGAS]
            cells.append(f"{np.nanmax(found):.2f}")
        lines.append(f"| {title} | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
