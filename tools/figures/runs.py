"""Runs of scenario files, each made once, in units that a figure shows."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from afm_model import Scenario, Simulation, changed, load_scenario, simulate
from afm_model.parameters import Value
from afm_model.plant.physics import PlantPhysics

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "scenarios"
_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Units:
    """The paper's units in the units of the figures."""

    time: float  # [ms]
    length: float  # x0 [nm]
    height: float  # z0 [nm]
    speed: float  # x0 w0 [um/s]
    rise: float  # z0 w0 [um/s]
    force: float  # m_p w0^2 x0 [nN]
    load: float  # m_c w0^2 z0 [nN]


def units(microscope: PlantPhysics) -> Units:
    """Units of the nondimensional quantities."""
    scales, force = microscope.scales, microscope.units
    return Units(
        time=1e3 / scales.w0,
        length=1e9 * scales.x0,
        height=1e9 * scales.z0,
        speed=1e6 * scales.x0 * scales.w0,
        rise=1e6 * scales.z0 * scales.w0,
        force=1e9 * force.lateral_force,
        load=1e9 * force.normal_force,
    )


class Runs:
    """Scenarios by name, each simulated once and kept for the figures that share it.

    Parameters
    ----------
    duration : float [s], optional
        Cut every run to this, for a quick look.
    """

    def __init__(self, duration: float | None = None) -> None:
        self._duration = duration
        self._kept: dict[str, Simulation] = {}

    def scenario(self, name: str) -> Scenario:
        """The scenario `name`: of docs/scenarios, or one that comes with afm_model."""
        file = FOLDER / f"{name}.yaml"
        return load_scenario(file if file.exists() else name)

    def __call__(self, name: str, **values: Value) -> Simulation:
        """The run of a scenario, with `values` in place of its own: `group__name` for group.name."""
        key = f"{name} {sorted(values.items())}"
        if key not in self._kept:
            scenario = self.scenario(name)
            own = {name.replace("__", "."): value for name, value in values.items()}
            law = {name: value for name, value in own.items() if name.startswith("law.")}
            sim = {name: value for name, value in own.items() if name not in law}
            duration = float(sim.get("run.duration", scenario.sim.run.duration))
            if self._duration is not None and self._duration < duration:
                sim["run.duration"] = self._duration
            self._kept[key] = simulate(
                changed(scenario.sim, sim),
                changed(scenario.controller, law),
            )
        return self._kept[key]


def scored(run: Simulation) -> NDArray[np.bool_]:
    """Which ticks are scored; all of them if the run ends before."""
    inside = run.time >= run.parameters.score_start - 1e-12
    return inside if inside.any() else np.ones_like(inside)


def friction(run: Simulation) -> _Array:
    """Friction on the scanner along x and y at the ticks, (n, 2) [nN]."""
    return 1e9 * np.column_stack([run.lateral_force, run.lateral_force_y])


def control_force(run: Simulation) -> _Array:
    """Drive of x and y as the force m_p u on the scanner, (n, 2) [nN]."""
    p = run.parameters
    mass = p.scanner.mass_ratio * p.cantilever.m_c
    stiffness = [mass * (2.0 * np.pi * f) ** 2 for f in (p.scanner.f_x, p.scanner.f_y)]
    newton_per_volt = np.array(stiffness) * [p.piezo.sensitivity_x, p.piezo.sensitivity_y]
    return 1e9 * run.drive[:, :2] * newton_per_volt


def errors(run: Simulation) -> _Array:
    """e = (e_x, e_x', e_y, e_y', e_z, e_z') of section 3, (n, 6), nondimensional; z is the tip height."""
    m, p = run.measurements, run.parameters
    x0, z0, w0 = p.scales.x0, p.scales.z0, p.scales.w0
    e = np.empty((len(m), 6))
    e[:, 0:4:2] = (m.position - m.reference_position)[:, :2] / x0
    e[:, 1:4:2] = (m.velocity - m.reference_velocity)[:, :2] / (x0 * w0)
    e[:, 4] = (m.deflection + p.cantilever.a - m.reference_position[:, 2]) / z0
    e[:, 5] = m.deflection_rate / (z0 * w0)
    return e
