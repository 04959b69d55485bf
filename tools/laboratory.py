"""A laboratory microscope: what its figures share, and the table of the laws on its scanner."""

import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from afm_model import ControllerParameters, SimParameters, build, simulate
from afm_model.parameters.microscope_parameters import resolved

sys.path.insert(0, str(Path(__file__).parent))
from law_pages import table

CERAMIC: dict[str, str | float] = {
    "piezo.kind": "ceramic",
    "piezo.hysteresis_x": 0.12,
    "piezo.hysteresis_y": 0.12,
    "piezo.stroke_x": 90e-6,
    "piezo.stroke_y": 90e-6,
    "piezo.creep": 0.02,
}
"""A piezo without correction: `piezo.*`."""
RATES = (("50 us", 5e-5, 0), ("50 us + 1", 5e-5, 1), ("200 us + 1", 2e-4, 1))
"""Control period [s] and delay in periods."""
LINES = 0.1
"""Period of the scan of a laboratory microscope [s]."""
LABORATORY = {
    "microscope.lever": "ppp_lfmr",
    "microscope.scanner": "flexure_90um",
    "microscope.pair": "si_sio2",
    "microscope.setpoint_force": 10e-9,
}
SENSORS = {"detector.deflection_noise_density": 3e-13, "detector.position_noise": 5e-11}
IMPERFECT: tuple[tuple[str, dict[str, Any], dict[str, Any]], ...] = (
    ("ideal", {}, {}),
    ("hysteresis 12 %, creep 2 %", CERAMIC, {}),
    ("and 50 pm of noise", CERAMIC | SENSORS, {"law.position_noise": SENSORS["detector.position_noise"]}),
)
"""The scanner and its sensors, and what `load` is given of them."""


def scan(
    law: dict[str, Any], plant: dict[str, Any], amplitude: float, period: float, delay: int
) -> tuple[SimParameters, ControllerParameters]:
    """Return the parameters of four lines of a sine along x and y, z by the loop inside; the last two are scored."""
    common = LABORATORY | {"microscope.control_period": period, "microscope.delay_ticks": delay}
    sim = {"sample.kind": "flat", "onboard.kind": "pi", "run.duration": 4.0 * LINES, "score.start": 2.0 * LINES}
    sim |= {f"reference.amplitude_{axis}": amplitude for axis in "xy"}
    sim |= {f"reference.omega_{axis}": 2.0 * math.pi / LINES for axis in "xy"}
    timing = {"law.period": period, "law.delay_ticks": delay}
    return (
        build(SimParameters, resolved(SimParameters, common | sim | plant)),
        build(ControllerParameters, resolved(ControllerParameters, common | timing | law)),
    )


def laboratory(titles: Iterable[str] = (), amplitudes: Iterable[float] = (5e-9, 20e-6)) -> str:
    """Measure the largest errors of `pid`, `observer` and `load` where friction does not move the scanner."""
    rates = RATES
    rows = []
    for title, plant, told in IMPERFECT:
        if titles and title not in titles:
            continue
        for amplitude in amplitudes:
            cells = []
            for _, period, delay in rates:
                errors = []
                for law in ({"law.kind": "pid"}, {"law.kind": "observer"}, {"law.kind": "load"} | told):
                    score = simulate(*scan(law, plant, amplitude, period, delay)).score
                    errors.append(f"{max(score.max_percent[:2]):.2g}")
                cells.append("; ".join(errors))
            size = f"{1e9 * amplitude:g} nm" if amplitude < 1e-6 else f"{1e6 * amplitude:g} um"
            rows.append([f"{title}, {size}", *cells])
    return table(["pid; observer; load [%]", *(rate[0] for rate in rates)], rows)
