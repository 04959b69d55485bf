"""A tip that taps, z loop and lock-in at work: the resolved plant, and the one averaged over the cycle."""

from typing import Any

from lever import time_of_a_tick

TAPPING: dict[str, Any] = {
    "plant.lever": "ppp_fmr",
    "plant.gap": 21e-9,
    "plant.control_period": 100e-6,
    "sample.kind": "patches",
    "reference.kind": "verbs",
    "onboard.kind": "dynamic",
    "onboard.regulate": "amplitude",
    "onboard.drive_amplitude": 85e-12,
    "onboard.free_amplitude": 20e-9,
    "onboard.setpoint_share": 0.7,
    "onboard.integral_gain": 10e-6,
    "detector.sample_period": 2e-6,
    "detector.channels": "z_loop, amplitude, phase",
}
FINE: dict[str, Any] = {"plant.kind": "lever", "plant.dt": 1e-7}
TOUCHING: dict[str, Any] = {"plant.gap": 14e-9}
CASES: dict[str, dict[str, Any]] = {
    "resolved, 0.1 us, ADC at 2 us, attraction": FINE,
    "resolved, 0.1 us, ADC at 2 us, touching": FINE | TOUCHING,
    "averaged, 2 us, touching": TOUCHING | {"plant.kind": "averaged", "plant.dt": 2e-6},
    "averaged, 5 us, touching": TOUCHING | {"plant.kind": "averaged", "plant.dt": 5e-6, "detector.sample_period": 5e-6},
}
TICKS = 20
"""In a stretch, 2 ms; the lower quartile of many counts, in processor time: a busy machine spoils some."""


def measure(stretches: int = 60) -> dict[str, Any]:
    """Of each case by name: `ns_per_sample` of the ADC, with all that belongs to it, and `real_time_factor`."""
    return {name: _case(values, stretches) for name, values in CASES.items()}


def _case(values: dict[str, Any], stretches: int) -> dict[str, float]:
    parameters, usual = time_of_a_tick(TAPPING | values, TICKS, stretches)
    period, sample = parameters.plant.control_period, parameters.detector.sample_period
    return {"ns_per_sample": usual * sample / period * 1e9, "real_time_factor": period / usual}
