"""Claims about amplitude curves beside those of another simulator: the engine of dForce, as released with pyDAMPF.

Its numbers are in docs/dynamic.md, with where they come from. It has a point on a spring, we have a beam: the stiffness
of our first mode is that of its spring, and the tip is driven, not the base. Its contact begins at 0.165 nm.
"""

import math
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from afm_model.analysis import tapping_energy
from afm_model.microscope import AmplitudeCurve

from ..clamped_mode import clamped_mode
from .test_amplitude_jumps import followed
from .test_tune import driven

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))

from figures.page import read  # noqa: E402

PAGE = ROOT / "docs" / "dynamic.md"
STIFFER = clamped_mode(0).stiffness
"""Stiffness of the first mode over the spring constant."""
SHOWN = 2.0 / 3.0 * 1.3765
"""Deflection that the photodiode shows over that of the end, in the first mode."""
FREE, CONTACT = 10e-9, 0.165e-9
"""Free amplitude of the end; distance at which dForce's contact begins [m]."""


class Case(NamedTuple):
    """SI units."""

    f0: float
    k: float
    Q: float
    radius: float
    modulus: float  # E*
    dt: float
    hamaker: float = 1e-24  # 0 would be that of the preset
    viscosity: float = 0.0


CASES = {
    "PVA, dry": Case(80e3, 2.7, 150.0, 8e-9, 930e6, 1e-7),
    "PVA, damp, viscous": Case(350e3, 42.0, 400.0, 8e-9, 248.8e6, 2.5e-8, viscosity=30.0),
    "attraction": Case(350e3, 40.0, 400.0, 10e-9, 930e6, 2.5e-8, hamaker=1e-19),
}


class Row(NamedTuple):
    """As dForce has it, and as it is here."""

    distance: float
    amplitude: tuple[float, float]
    phase: tuple[float, float]
    dissipated: tuple[float, float]


def rows(name: str) -> list[Row]:
    """Of the page: [nm], [deg], [1e-20 J]."""
    found = []
    for case, distance, *cells in read(PAGE, "dforce"):
        if case == name:
            pairs = [tuple(float(each) for each in cell.split(" / ")) for cell in cells]
            found.append(Row(float(distance), *pairs))
    return found


def motion(case: Case, distances: np.ndarray) -> np.ndarray:
    """A exp(-i phi) of the end at these distances [nm], the mean of the way there and back: neither lags then."""
    adhesion = case.hamaker / (12.0 * math.pi * CONTACT**2)
    gap, last, first = 50e-9, 1e-9 * distances.min() - 0.3e-9, 1.05 * FREE
    lever = {"kind": "lever", "lever": "ppp_fmr", "k": case.k / STIFFER, "f0": case.f0, "Q": case.Q, "modes": 1}
    lever |= {"tip_radius": case.radius, "tilt": 0.0, "gap": gap, "dt": case.dt, "tau": 1.0}
    lever |= {"contact": "dmt", "K": 4.0 / 3.0 * case.modulus, "viscosity": case.viscosity}
    lever |= {"hamaker": case.hamaker, "work_of_adhesion": adhesion}
    drive = {"drive": "tip", "drive_amplitude": FREE * STIFFER / case.Q, "time_constant": 50e-6}
    given: dict[str, Any] = {f"plant__{name}": each for name, each in lever.items()}
    given |= {f"onboard__{name}": each for name, each in drive.items()}
    microscope = driven(**given, detector__sample_period=20.0 * case.dt)
    curve = AmplitudeCurve(begin=gap - first, ramp=first - last, rate=4e-8, settle=0.01, points=800)
    outcome, apart, shown = followed(microscope, gap, curve)
    assert outcome.status == "complete"
    ways = []
    for d, moved in zip(apart + CONTACT, shown / SHOWN, strict=True):
        at = np.argsort(d)
        ways.append(np.interp(1e-9 * distances, d[at], moved[at]))
    return np.mean(ways, axis=0)


@pytest.mark.parametrize(
    "name", ["PVA, dry", *(pytest.param(each, marks=pytest.mark.long) for each in list(CASES)[1:])]
)
def test_amplitude_phase_and_energy_are_those_of_dforce(name):
    case, told = CASES[name], rows(name)
    assert len(told) == 3
    found = motion(case, np.array([row.distance for row in told]))
    energy = tapping_energy(found, -1j * FREE, frequency=case.f0, f0=case.f0, Q=case.Q, k=case.k).dissipated
    for row, moved, lost in zip(told, found, energy, strict=True):
        amplitude, phase = 1e9 * abs(moved), -math.degrees(np.angle(moved))
        assert amplitude == pytest.approx(row.amplitude[0], rel=1.5e-3)
        assert phase == pytest.approx(row.phase[0], abs=0.2)
        # Of what the drive does at most in a cycle.
        scale = math.pi * case.k * FREE * abs(moved) / case.Q * 1e20
        assert 1e20 * lost == pytest.approx(row.dissipated[0], abs=2e-3 * scale)
        assert row.amplitude[1] == pytest.approx(amplitude, abs=1e-4)
        assert row.phase[1] == pytest.approx(phase, abs=1e-2)
        assert row.dissipated[1] == pytest.approx(1e20 * lost, abs=0.06)
