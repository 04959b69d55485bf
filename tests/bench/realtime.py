"""Lateness of the realtime loop at 1 kHz, beside a bare loop in C that does nothing but wake."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

from loops import Run, percentiles

_PERIOD = 1e-3
_CONTROL_PERIOD = 2e-6
_PRIORITY = 80
_SPIN = 2e-4


def _compile(folder: Path) -> Path | None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return None
    program = folder / "deadline"
    subprocess.run([compiler, "-O3", "-o", str(program), str(Path(__file__).with_name("deadline.c"))], check=True)
    return program


def measure(folder: Path, seconds: float) -> list[dict[str, Any]]:
    """Lateness with ordinary scheduling, and with priority, locked memory and polling before each deadline.

    The simulator runs slowed, so that a control period of 2 us takes a millisecond of wall time.
    """
    program = _compile(folder)
    rows = []
    for privileged in (False, True):
        priority, spin = (_PRIORITY, _SPIN) if privileged else (0, 0.0)
        ticks = round(seconds / _PERIOD)
        floor = None
        if program is not None:
            arguments = [round(_PERIOD * 1e9), ticks // 3, priority, round(spin * 1e9)]
            said = subprocess.run([str(program), *map(str, arguments)], capture_output=True, check=True).stdout
            floor = json.loads(said)
        run = Run(
            folder,
            composed=False,
            parameters={
                "plant.control_period": _CONTROL_PERIOD,
                "run.mode": "realtime",
                "run.real_time_factor": _CONTROL_PERIOD / _PERIOD,
                "run.duration": ticks * _CONTROL_PERIOD,
                "run.spin_time": spin,
            },
            process={"fifo_priority": priority, "lock_memory": privileged},
        )
        score = run.score()
        rows.append(
            {
                "privileged": privileged,
                "seconds": seconds,
                "lateness_s": percentiles(score.lateness),
                "periods_missed": score.periods_missed,
                "command_age_s": percentiles(score.command_age),
                "c": floor,
            }
        )
    return rows
