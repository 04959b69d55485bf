"""One step of the compliant plant: numba against the same algorithm in C, in the same run, from the same state."""

import ctypes
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from afm_model import InstrumentParameters, build
from afm_model.compiled.records import pointer_at, record_at, size
from afm_model.instrument.block import Layout
from afm_model.parts.header import BlockHeader
from afm_model.parts.signals import Drive
from afm_model.plant import Constants, State, compliant

COMPILER = "cc"
FLAGS = {
    "c": ["-O3", "-shared", "-fPIC"],
    # Contraction to fused operations is another rounding and gains two percent: a step waits for roots and divisions.
    "c_native": ["-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC"],
}
DT = 1e-6
"""Integration step [s]."""
HOLD = 20
"""Steps for which each drive is held."""
STRETCH = 100
"""Drives in a stretch. A stretch is timed on its own, and its best time counts: with 0.4 ms of work, some repeat of it
escapes whatever else the machine does, which a whole run does not."""
TOLERANCE = 1e-12
"""Largest relative difference of the end states: both round alike, up to what a compiler may reorder."""

_Array = NDArray[np.float64]
Advance = Callable[[_Array, _Array, int], None]


class CompilerError(RuntimeError):
    """There is no C to compare with; the message tells why."""


# Not cached: the cache remembers by which name a module was imported, and this one has two.
@numba.njit(error_model="numpy")
def advance(m: _Array, u: _Array, hold: int) -> None:
    """Advance the plant of the block `m` by `hold` steps under each row of `u`, the drive (x, y, z) [V]."""
    g = record_at(m, 0, BlockHeader)
    p, s = record_at(m, g.plant_constants, Constants), record_at(m, g.plant_state, State)
    v = record_at(m, g.effective, Drive)
    unused = pointer_at(m, 0)
    for i in range(len(u)):
        for axis in range(3):
            v.voltage[axis] = u[i, axis]
        for _ in range(hold):
            compliant.step(0.0, v, unused, p, s, m)


def compile_c(folder: Path, name: str) -> Advance:
    """`plant.c` compiled into `folder` with `FLAGS[name]`, to be called as `advance` is."""
    if shutil.which(COMPILER) is None:
        raise CompilerError(f"no C compiler: `{COMPILER}` is not on the PATH")
    library = folder / f"plant_{name}.so"
    source = Path(__file__).with_name("plant.c")
    command = [COMPILER, *FLAGS[name], "-o", str(library), str(source), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    if done.returncode != 0:
        raise CompilerError(f"{' '.join(command)}: {done.stderr.strip()}")
    function = ctypes.CDLL(str(library)).advance
    function.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_long] * 2
    function.restype = None

    def advance_c(m: _Array, u: _Array, hold: int) -> None:
        g = record_at(m, 0, BlockHeader)
        places = (m[place:].ctypes.data for place in (g.plant_state, g.plant_constants, g.sample_constants))
        function(*places, u.ctypes.data, len(u), hold)

    return advance_c


def problem() -> tuple[_Array, _Array]:
    """Block at rest, drives [V]: one period of the open loop, in which the scanner sticks half of the time."""
    parameters = build(InstrumentParameters, {"plant.dt": DT})
    layout = Layout(parameters)
    m = layout.make(parameters)
    p = layout.record(m, "plant_constants")
    held = compliant.COMPLIANT.rest(parameters, p, layout.record(m, "plant_state"), m)
    omega = 0.005
    t = np.arange(0.0, 2.0 * np.pi / omega, HOLD * p.h)
    u = 20.0 * np.sin(omega * t)
    return m, np.column_stack([u / p.gain_x, u / p.gain_y, np.full(len(t), held[2])])


def gains(m: _Array) -> _Array:
    """Drive in the units of the equations per volt, along x, y, z."""
    p = record_at(m, record_at(m, 0, BlockHeader).plant_constants, Constants)
    return np.array([p.gain_x, p.gain_y, p.gain_z])


def state(m: _Array) -> Any:
    """Record of the plant's state in the block `m`."""
    return record_at(m, record_at(m, 0, BlockHeader).plant_state, State)


def difference(one: _Array, other: _Array) -> float:
    """Largest relative difference of the states in two blocks, component by component."""
    a, b = (np.array(state(m).tolist()) for m in (one, other))
    assert a.shape == b.shape == (size(State),)
    larger = np.maximum(np.abs(a), np.abs(b))
    return float(np.max(np.abs(a - b) / np.where(larger > 0.0, larger, 1.0)))


def measure(folder: Path, repeats: int = 15) -> dict[str, Any]:
    """Time of a step in numba and in C, run in turn stretch by stretch, each stretch at its best of `repeats` times.

    Parameters
    ----------
    folder : Path
        Where the compiled C goes.
    repeats : int

    Returns
    -------
    dict
        `steps` of the run, `dt` [s], `compiler`; under `numba`, `c` and `c_native` each: `ns_per_step`,
        `real_time_factor` (simulated over wall time on one core); under the latter two also `flags` and `ratio`,
        numba's time over this one's. Without a compiler, `reason` alone.

    Raises
    ------
    RuntimeError
        If C and numba do not end in the same state: their times are then those of different algorithms.
    """
    try:
        contestants: dict[str, Advance] = {"numba": advance} | {name: compile_c(folder, name) for name in FLAGS}
    except CompilerError as error:
        return {"reason": str(error)}
    start, u = problem()
    steps = len(u) * HOLD
    advance(start.copy(), u[:1], HOLD)  # Compiles.
    stretches = [u[row : row + STRETCH] for row in range(0, len(u), STRETCH)]
    best = {name: np.full(len(stretches), np.inf) for name in contestants}
    for _ in range(repeats):
        blocks = {name: start.copy() for name in contestants}
        for i, stretch in enumerate(stretches):
            for name, contestant in contestants.items():
                begin = time.perf_counter_ns()
                contestant(blocks[name], stretch, HOLD)
                best[name][i] = min(best[name][i], time.perf_counter_ns() - begin)
        for name in FLAGS:
            if not (apart := difference(blocks["numba"], blocks[name])) <= TOLERANCE:
                raise RuntimeError(f"plant.c ({name}) is not the plant of afm_model: end states differ by {apart:.1e}")
    per_step = {name: float(times.sum()) / steps for name, times in best.items()}
    version = subprocess.run([COMPILER, "--version"], capture_output=True, text=True, check=False, timeout=60).stdout
    result: dict[str, Any] = {"steps": steps, "dt": DT, "compiler": version.partition("\n")[0]}
    for name, ns in per_step.items():
        result[name] = {"ns_per_step": ns, "real_time_factor": DT / (ns * 1e-9)}
    for name, flags in FLAGS.items():
        result[name] |= {"flags": " ".join(flags), "ratio": per_step["numba"] / per_step[name]}
    return result
