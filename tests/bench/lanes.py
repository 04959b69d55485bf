"""One step of a plant for many instruments: in lanes, one after the other, and of `compliant` in C as well."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import kernel
import numba
import numpy as np
from numpy.typing import NDArray

from afm_model import Controller, ControllerParameters, Instrument, SimParameters, build
from afm_model.compiled.lanes import LANES, Own
from afm_model.compiled.records import numbers_at, place, record_at, size
from afm_model.instrument.block import LoopState
from afm_model.instrument.tick import MOVED
from afm_model.lanes import loop as together
from afm_model.lanes.together import run_together
from afm_model.parts.dispatch import observe, step
from afm_model.parts.header import BlockHeader
from afm_model.parts.signals import Actuation, Truth
from afm_model.plant import Constants, State, compliant
from afm_model.sample import paper

_Array = NDArray[np.float64]
PERIOD = 50e-6
"""Control period of the closed loops [s]."""
DURATION = 0.2
"""Of each of their runs [s]."""
SAMPLED = {
    "plant.control_period": PERIOD,
    "detector.sample_period": PERIOD,
    "run.duration": DURATION,
    "score.start": 0.0,
}
SLIDING = {"plant.kind": "lever", "sample.kind": "flat", **SAMPLED}
_MARKED = place(Own, "marked")


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

    def starting() -> dict[str, Any]:
        return {name: [block.copy() for block in starts] for name in contestants} | {"lanes": a.copy().reshape(-1)}

    def check(data: dict[str, Any]) -> None:
        alone = np.array([block[header.plant_state : header.plant_state + size(State)] for block in data["scalar"]])
        if not np.array_equal(data["lanes"].reshape(-1, LANES)[states].T, alone):
            raise RuntimeError("lanes and instruments one by one do not end in the same state")

    stretches = [u[row : row + kernel.STRETCH] for row in range(0, len(u), kernel.STRETCH)]
    return _in_turn(contestants, starting, check, stretches, len(u) * kernel.HOLD * LANES, repeats)


def _in_turn(
    contestants: dict[str, Callable[[Any, _Array], None]],
    starting: Callable[[], dict[str, Any]],
    check: Callable[[dict[str, Any]], None],
    stretches: list[_Array],
    steps: int,
    repeats: int,
) -> dict[str, float]:
    """Processor time of a step by name [ns]: each stretch of drives at its best of `repeats`."""
    best = {name: np.full(len(stretches), np.inf) for name in contestants}
    for repeat in range(repeats + 1):  # The first compiles.
        data = starting()
        for i, stretch in enumerate(stretches[: 1 if repeat == 0 else None]):
            for name, run in contestants.items():
                begin = time.thread_time_ns()
                run(data[name], stretch)
                if repeat > 0:
                    best[name][i] = min(best[name][i], time.thread_time_ns() - begin)
        check(data)
    return {name: float(times.sum()) / steps for name, times in best.items()}


@numba.njit(error_model="numpy")
def advance_one_by_one(addresses: Any, u: _Array, hold: int) -> None:
    """Advance instruments by `hold` steps under each row of `u`, and tell what is true behind each step."""
    for address in addresses:
        m = numbers_at(address, 1)
        g = record_at(m, 0, BlockHeader)
        c = record_at(m, g.loop, LoopState)
        v, o = record_at(m, g.effective, Actuation), record_at(m, g.truth, Truth)
        h = c.control_period / c.substeps
        for i in range(len(u)):
            for axis in range(3):
                v.voltage[axis] = u[i, axis]
            for k in range(hold):
                step(k * h, v, m, m)
                observe(o, m)


@numba.njit(error_model="numpy")
def advance_marking(lanes: Any, a: _Array, addresses: Any, u: _Array, hold: int, drive: int, sizes: Any) -> int:
    """The same in lanes that the routine of one alone helps; how many steps it made."""
    outcomes, marked = np.full(LANES, MOVED), 0
    for i in range(len(u)):
        for lane in range(LANES):
            m = numbers_at(addresses[lane], 1)
            v = record_at(m, record_at(m, 0, BlockHeader).effective, Actuation)
            for axis in range(3):
                a[(drive + axis) * LANES + lane] = v.voltage[axis] = u[i, axis]
        for k in range(hold):
            together._steps(lanes, a, addresses, outcomes, k, 1, hold, False, sizes)
            for lane in range(LANES):
                marked += a[_MARKED * LANES + lane] != 0.0
    return marked


def slides() -> list[tuple[SimParameters, ControllerParameters]]:
    """Sets with the plant `lever`, each with its own amplitude along x."""
    law = build(ControllerParameters, {"law.kind": "open_loop"})
    return [
        (build(SimParameters, {**SLIDING, "reference.amplitude_x": (20.0 + 0.1 * i) * 1e-9}), law) for i in range(LANES)
    ]


def measure_lever(repeats: int = 7) -> dict[str, float]:
    """Processor time of a step of the plant `lever` [ns], which slides on a flat sample and turns: `lanes`, `scalar`;
    and the share of steps that lanes leave to the routine of one alone, `left`.

    Each instrument has its own friction. Both tell what is true behind each step.

    Raises
    ------
    RuntimeError
        If lanes and instruments one by one do not end in the same bits.
    """
    sets = slides()
    alone, many = ([Instrument(sim) for sim, _ in sets] for _ in range(2))
    block = together.Together(many, [Controller(law) for _, law in sets])
    lanes = block._lanes
    sizes, drive = (size(lanes.records["state"]), size(lanes.records["ledger"])), lanes.places["drive"]
    numbers = slice(lanes.places["state"], lanes.places["state"] + sum(sizes))
    for i, pair in enumerate(zip(alone, many, strict=True)):
        for each in pair:
            constants = each.record("plant_constants")
            constants.friction_per_area *= 1.0 + 0.01 * i
    hold = round(PERIOD / constants.h)
    angles = np.arange(0.0, 2.0 * np.pi, 0.05)
    u = np.outer(np.sin(angles), [20e-9, 5e-9, 0.0]) / np.array(constants.metres) + alone[0].numbers("applied")[:3]
    addresses, left = np.array([each.address for each in alone]), [0]

    def starting() -> dict[str, Any]:
        for each in (*alone, *many):
            each.reset()
        block._fill(range(LANES))
        left[0] = 0
        return {"scalar": None, "lanes": None}

    def one_by_one(_: Any, u: _Array) -> None:
        advance_one_by_one(addresses, u, hold)

    def in_lanes(_: Any, u: _Array) -> None:
        left[0] += advance_marking(lanes, block._block, block._addresses, u, hold, drive, sizes)

    def check(_: dict[str, Any]) -> None:
        ends = [np.concatenate([each.numbers("plant_state"), each.numbers("plant_ledger")]) for each in alone]
        if block._numbers[numbers].T.tobytes() != np.array(ends).tobytes():
            raise RuntimeError("lanes and instruments one by one do not end in the same state")

    stretches = [u[row : row + 6] for row in range(0, len(u), 6)]
    steps = len(u) * hold * LANES
    found = _in_turn({"scalar": one_by_one, "lanes": in_lanes}, starting, check, stretches, steps, repeats)
    return found | {"left": left[0] / steps}


def loops(kind: str) -> list[tuple[SimParameters, ControllerParameters]]:
    """Closed loops with a law, each with its own random numbers."""
    period = {"law.period": PERIOD} if kind == "pid" else {}
    law = build(ControllerParameters, {"law.kind": kind, **period})
    return [(build(SimParameters, {**SAMPLED, "plant.seed": i}), law) for i in range(LANES)]


def measure_loops(repeats: int = 2) -> dict[str, dict[str, float]]:
    """Processor time of a step of one instrument in whole runs at 50 us [ns]: `lanes` and `scalar`, in turn; closed
    loops by law, and `lever` in open loop.

    One sample of the ADC in a control period, as in sweeps. The time to make the instruments is in both.

    Raises
    ------
    RuntimeError
        If trajectories differ.
    """
    times: dict[str, dict[str, float]] = {}
    for kind in ("tanh", "pid", "lever"):
        sets = slides() if kind == "lever" else loops(kind)
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
