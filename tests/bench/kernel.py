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

from afm_model import InstrumentParameters
from afm_model.plant import PLANT_RECORD, plant_constants, rest, state, step_compliant

COMPILER = "cc"
FLAGS = {
    "c": ["-O3", "-shared", "-fPIC"],
    # Contraction to fused operations is another rounding and gains two percent: a step waits for pow, sqrt, division.
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
Advance = Callable[[_Array, _Array, _Array, int], None]


class CompilerError(RuntimeError):
    """There is no C to compare with; the message tells why."""


# Not cached: the cache remembers by which name a module was imported, and this one has two.
@numba.njit(error_model="numpy")
def advance(s: _Array, constants: _Array, u: _Array, hold: int) -> None:
    """Advance `s` by `hold` steps under each row of `u`, the drive (x, y, z)."""
    p = constants.view(PLANT_RECORD)[0]
    for i in range(len(u)):
        for _ in range(hold):
            step_compliant(s, p, u[i, 0], u[i, 1], u[i, 2])


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
    function.argtypes = [ctypes.c_void_p] * 3 + [ctypes.c_long] * 2
    function.restype = None

    def advance_c(s: _Array, constants: _Array, u: _Array, hold: int) -> None:
        function(s.ctypes.data, constants.ctypes.data, u.ctypes.data, len(u), hold)

    return advance_c


def problem() -> tuple[_Array, _Array, _Array]:
    """State at rest, constants, drives: one period of the open loop, in which the scanner sticks half of the time."""
    parameters = InstrumentParameters()
    constants = plant_constants(parameters, DT)
    s, u_z = rest(constants, parameters.reference.z_r / parameters.scales.z0)
    omega = 0.005
    h = constants.view(PLANT_RECORD)[0].h
    t = np.arange(0.0, 2.0 * np.pi / omega, HOLD * h)
    u = 20.0 * np.sin(omega * t)
    return s, constants, np.column_stack([u, u, np.full(len(t), u_z)])


def difference(one: _Array, other: _Array) -> float:
    """Largest relative difference of two states, component by component."""
    assert one.shape == other.shape == (state.SIZE,)
    larger = np.maximum(np.abs(one), np.abs(other))
    return float(np.max(np.abs(one - other) / np.where(larger > 0.0, larger, 1.0)))


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
    start, constants, u = problem()
    steps = len(u) * HOLD
    advance(start.copy(), constants, u[:1], HOLD)  # Compiles.
    stretches = [u[row : row + STRETCH] for row in range(0, len(u), STRETCH)]
    best = {name: np.full(len(stretches), np.inf) for name in contestants}
    for _ in range(repeats):
        states = {name: start.copy() for name in contestants}
        for i, stretch in enumerate(stretches):
            for name, contestant in contestants.items():
                begin = time.perf_counter_ns()
                contestant(states[name], constants, stretch, HOLD)
                best[name][i] = min(best[name][i], time.perf_counter_ns() - begin)
        for name in FLAGS:
            if not (apart := difference(states["numba"], states[name])) <= TOLERANCE:
                raise RuntimeError(f"plant.c ({name}) is not the plant of afm_model: end states differ by {apart:.1e}")
    per_step = {name: float(times.sum()) / steps for name, times in best.items()}
    version = subprocess.run([COMPILER, "--version"], capture_output=True, text=True, check=False, timeout=60).stdout
    result: dict[str, Any] = {"steps": steps, "dt": DT, "compiler": version.partition("\n")[0]}
    for name, ns in per_step.items():
        result[name] = {"ns_per_step": ns, "real_time_factor": DT / (ns * 1e-9)}
    for name, flags in FLAGS.items():
        result[name] |= {"flags": " ".join(flags), "ratio": per_step["numba"] / per_step[name]}
    return result
