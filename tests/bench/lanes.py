"""One step of the compliant plant for many instruments: in lanes, one after the other, and in C one after the other."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import kernel
import numba
import numpy as np
from numpy.typing import NDArray

from afm_model import ControllerParameters, SimParameters, build
from afm_model.core.lanes import LANES
from afm_model.core.records import record_at, size
from afm_model.instrument import lanes as together
from afm_model.parts.header import BlockHeader
from afm_model.plant import Constants, State, compliant
from afm_model.run.together import run_together
from afm_model.sample import paper

_Array = NDArray[np.float64]
PERIOD = 50e-6
"""Control period of the closed loops [s]."""
DURATION = 0.2
"""Of each of their runs [s]."""


@numba.njit(error_model="numpy")
def advance(lanes: Any, a: _Array, u: _Array, hold: int, drive: int) -> None:
    """Advance all lanes by `hold` steps under each row of `u`, the drive (x, y, z) [V] of all."""
    for i in range(len(u)):
        for axis in range(3):
            for lane in range(LANES):
                a[(drive + axis) * LANES + lane] = u[i, axis]
        together._steps(lanes, a, a, a, 0, hold, hold, False, (0, 0))


def problem() -> tuple[list[_Array], _Array]:
    """Blocks of LANES instruments, each with its own friction and adhesion, and drives [V]: see `kernel.problem`."""
    start, u = kernel.problem()
    blocks = [start.copy() for _ in range(LANES)]
    for i, block in enumerate(blocks):
        p = record_at(block, record_at(block, 0, BlockHeader).plant_constants, Constants)
        p.f_s *= 1.0 + 0.01 * i
        p.L_s *= 1.0 + 0.003 * i
    return blocks, u


def measure(folder: Path, repeats: int = 7) -> dict[str, Any]:
    """Processor time of a step of one instrument [ns], stretch by stretch in turn, each at its best of `repeats`.

    `lanes`, `scalar`; `c_native` with a compiler. Lanes also tell what is true behind each step, which a run needs.

    Raises
    ------
    RuntimeError
        If lanes and instruments one by one do not end in the same bits.
    """
    starts, u = problem()
    lanes = together._lanes_of(compliant.COMPLIANT, paper.PAPER, ())
    a = np.zeros((lanes.size, LANES))
    header = record_at(starts[0], 0, BlockHeader)
    states = slice(lanes.places["state"], lanes.places["state"] + size(State))
    for i, block in enumerate(starts):
        for name, at in (("state", "plant_state"), ("plant", "plant_constants"), ("sample", "sample_constants")):
            first = lanes.places[name]
            count = size(lanes.records[name])
            a[first : first + count, i] = block[header[at] : header[at] + count]
    contestants: dict[str, Callable[[Any, _Array], None]] = {}

    def one_by_one(step: kernel.Advance) -> Callable[[Any, _Array], None]:
        def run(blocks: Any, u: _Array) -> None:
            for block in blocks:
                step(block, u, kernel.HOLD)

        return run

    contestants["scalar"] = one_by_one(kernel.advance)
    try:
        contestants["c_native"] = one_by_one(kernel.compile_c(folder, "c_native"))
    except kernel.CompilerError:
        pass
    drive = lanes.places["drive"]
    contestants["lanes"] = lambda block, u: advance(lanes, block, u, kernel.HOLD, drive)
    stretches = [u[row : row + kernel.STRETCH] for row in range(0, len(u), kernel.STRETCH)]
    best = {name: np.full(len(stretches), np.inf) for name in contestants}
    for repeat in range(repeats + 1):  # The first compiles.
        data: dict[str, Any] = {name: [block.copy() for block in starts] for name in contestants}
        data["lanes"] = a.copy().reshape(-1)
        for i, stretch in enumerate(stretches[: 1 if repeat == 0 else None]):
            for name, run in contestants.items():
                begin = time.thread_time_ns()
                run(data[name], stretch)
                if repeat > 0:
                    best[name][i] = min(best[name][i], time.thread_time_ns() - begin)
        alone = np.array([block[header.plant_state : header.plant_state + size(State)] for block in data["scalar"]])
        if not np.array_equal(data["lanes"].reshape(-1, LANES)[states].T, alone):
            raise RuntimeError("lanes and instruments one by one do not end in the same state")
    steps = len(u) * kernel.HOLD * LANES
    return {name: float(times.sum()) / steps for name, times in best.items()}


def measure_loops(repeats: int = 2) -> dict[str, dict[str, float]]:
    """Processor time of a step of one instrument in a closed loop at 50 us [ns], by law: `lanes` and `scalar`, in turn.

    One sample of the ADC in a control period, as in sweeps. The time to make the instruments is in both.

    Raises
    ------
    RuntimeError
        If trajectories differ.
    """
    times: dict[str, dict[str, float]] = {}
    for kind in ("tanh", "pid"):
        period = {"law.period": PERIOD} if kind == "pid" else {}
        law = build(ControllerParameters, {"law.kind": kind, **period})
        values = {"plant.control_period": PERIOD, "detector.sample_period": PERIOD, "run.duration": DURATION}
        sets = [(build(SimParameters, {**values, "plant.seed": i, "score.start": 0.0}), law) for i in range(LANES)]
        best = times[kind] = {"lanes": np.inf, "scalar": np.inf}
        for repeat in range(repeats + 1):  # The first compiles.
            ends: list[list[str]] = []
            for name in best:
                begin = time.thread_time()
                found = run_together(sets, lanes=name == "lanes", block_ticks=512)
                taken = time.thread_time() - begin
                ends.append([str(each) if isinstance(each, Exception) else each.trajectory_sha256() for each in found])
                if repeat > 0:
                    best[name] = min(
                        best[name], 1e9 * taken / sum(sim.total_ticks * sim.plant.substeps for sim, _ in sets)
                    )
            if ends[0] != ends[1]:
                raise RuntimeError(f"with {kind}, lanes and instruments one by one differ")
    return times
