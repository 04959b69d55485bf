"""Claims about the thermal noise of the plant `lever`: equipartition and spectrum, against closed forms."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov
from scipy.signal import welch

from afm_model.plant.random_numbers import normal

from .lever_bench import LeverBench
from .test_lever import UPRIGHT, along, contact_under, series

KT = 1.380649e-23 * 295.0
FREE = {"plant__gap": 1e-6, "plant__tilt": 0.0, "plant__temperature": 295.0, "plant__torsion": "moving"}
COORDINATES = ("q_0", "q_1", "phi", "v_0", "v_1", "v_phi")


def set_to(s: Any, name: str, change: float) -> None:
    """Add to a coordinate of the state."""
    if name.endswith("phi"):
        s[name] += change
    else:
        s[name[0]][int(name[2])] += change


def read(s: Any) -> np.ndarray:
    return np.array([s.q[0], s.q[1], s.phi, s.v[0], s.v[1], s.v_phi])


def stationary(b: LeverBench) -> np.ndarray:
    """Covariance of COORDINATES that the linear map of one step and the random changes of rate lead to."""
    kicks = (*(float(kick) for kick in b.p.kick[:2]), float(b.p.twist_kick))
    b.p.kick[:] = 0.0
    b.p.twist_kick = 0.0
    b.stay(2)
    rest = b.numbers.copy()
    scale = np.sqrt(np.diag(boltzmann(b, np.zeros((3, 3)))))

    def end(name: str, change: float) -> np.ndarray:
        b.numbers[:] = rest
        if name.startswith("kick"):
            which = int(name[5])
            count = 4 * int(b.s.steps) + (3 if which == 2 else which)
            value = change / normal(int(b.p.thermal_key), count)
            if which == 2:
                b.p.twist_kick = value
            else:
                b.p.kick[which] = value
        else:
            set_to(b.s, name, change)
        b.stay(1)
        b.p.kick[:] = 0.0
        b.p.twist_kick = 0.0
        return read(b.s) / scale

    def slope(name: str, size: float) -> np.ndarray:
        return (end(name, size) - end(name, -size)) / (2.0 * size)

    small = 1e-4
    step = np.column_stack([slope(n, small * size) * size for n, size in zip(COORDINATES, scale, strict=True)])
    pushes = np.column_stack([slope(f"kick_{i}", small * kick) * kick for i, kick in enumerate(kicks)])
    return solve_discrete_lyapunov(step, pushes @ pushes.T) * np.outer(scale, scale)


def boltzmann(b: LeverBench, springs: np.ndarray) -> np.ndarray:
    """Covariance k_B T (K^-1, M^-1) of COORDINATES, with springs (3, 3) between the moving coordinates."""
    c = b.plant.cantilever_numbers
    own = np.array([c.k / (12.0 / 1.8751040687**4), c.k / (12.0 / 4.6940911330**4), c.k_torsion * math.pi**2 / 8.0])
    w2 = np.array([b.p.mode_w2[0], b.p.mode_w2[1], b.p.twist_w2])
    total = np.zeros((6, 6))
    total[:3, :3] = KT * np.linalg.inv(np.diag(own) + springs)
    total[3:, 3:] = np.diag(KT * w2 / own)
    return total


def in_units(covariance: np.ndarray, of: np.ndarray) -> np.ndarray:
    scale = np.sqrt(np.diag(of))
    return covariance / np.outer(scale, scale)


@pytest.mark.parametrize("step", [1e-6, 2.5e-7])
def test_equipartition_is_exact_at_any_step_free_and_in_contact(step):
    b = LeverBench(**FREE, plant__dt=step)
    expected = boltzmann(b, np.zeros((3, 3)))
    assert in_units(stationary(b), expected) == pytest.approx(np.eye(6), abs=1e-6)

    b = LeverBench(**UPRIGHT, plant__dt=step, plant__temperature=295.0, plant__torsion="moving")
    c = b.plant.cantilever_numbers
    a, across = contact_under(b, float(b.s.N))
    along = 8.0 * b.plant.pair_numbers.G * a
    arm = c.tip_height + 0.5 * c.thickness
    # Springs of the contact, behind what follows without delay.
    rest = np.array([[b.p.rest_yy, b.p.rest_yz], [b.p.rest_yz, b.p.rest_zz]])
    way = np.array([b.p.mode_y[:2], b.p.mode_z[:2]])
    springs = np.zeros((3, 3))
    springs[:2, :2] = way.T @ np.linalg.inv(np.diag([1.0 / along, 1.0 / across]) + rest) @ way
    side = series(c.k_torsion / arm**2 / (1.0 - 8.0 / math.pi**2), c.k_in_plane, along)
    springs[2, 2] = arm**2 * side
    expected = boltzmann(b, springs)
    found = stationary(b)
    assert in_units(found, expected) == pytest.approx(in_units(expected, expected), abs=1e-3)


def mean_squares(b: LeverBench, chunks: int, pick: Any) -> tuple[float, float]:
    """Mean square and its standard error, by the spread of the means of chunks of 0.1 s."""
    n = round(0.1 / b.plant.dt)
    b.stay(n // 10)
    means = [np.mean(pick(b.stay(n)) ** 2) for _ in range(chunks)]
    return float(np.mean(means)), float(np.std(means, ddof=1) / chunks**0.5)


@pytest.mark.parametrize(("step", "modes"), [(1e-6, 2), (5e-7, 3)])
def test_a_free_cantilever_fluctuates_by_kT_over_k_whatever_the_step(step, modes):
    b = LeverBench(**FREE, plant__dt=step, plant__modes=modes, plant__Q=10.0)
    c = b.plant.cantilever_numbers
    part = sum(12.0 / x**4 for x in (1.8751040687, 4.6940911330, 7.8547574382)[:modes])
    found, error = mean_squares(b, 10, lambda r: r.tip)
    assert error < 0.02 * KT / c.k
    assert found == pytest.approx(part * KT / c.k, abs=3.0 * error)
    found, error = mean_squares(b, 5, lambda r: r.twist)
    assert error < 0.01 * KT / c.k_torsion
    assert found == pytest.approx(8.0 / math.pi**2 * KT / c.k_torsion, abs=3.0 * error)


def test_spectra_of_what_the_photodiode_shows_are_those_of_damped_oscillators():
    step, chunk = 2.5e-7, 2**17
    b = LeverBench(**FREE, plant__dt=step, plant__Q=10.0, plant__Q_torsion=20.0)
    c = b.plant.cantilever_numbers
    arm = c.tip_height + 0.5 * c.thickness
    b.stay(chunk)
    spectra = {"deflection": 0.0, "force": 0.0}
    chunks = 16
    for _ in range(chunks):
        r = b.stay(chunk)
        for name, shown in (("deflection", r.shown), ("force", c.k_torsion / arm * r.twist)):
            f, density = welch(shown, 1.0 / step, nperseg=2**14)
            spectra[name] = spectra[name] + density / chunks

    def oscillator(variance: float, f_0: float, Q: float) -> np.ndarray:
        """One-sided density whose integral is the variance."""
        return 2.0 * variance / (math.pi * f_0 * Q) / ((1.0 - (f / f_0) ** 2) ** 2 + (f / (f_0 * Q)) ** 2)

    # Static deflection and slope of the end of each mode: 2/3 of the slope is shown.
    bending = sum(
        oscillator((2.0 / 3.0 * slope) ** 2 * 12.0 / x**4 * KT / c.k, c.f0 * (x / 1.8751040687) ** 2, 10.0)
        for x, slope in ((1.8751040687, 1.3765), (4.6940911330, 4.7808))
    )
    twist = oscillator((c.k_torsion / arm) ** 2 * 8.0 / math.pi**2 * KT / c.k_torsion, c.f_torsion, 20.0)
    for name, expected, low, high in (("deflection", bending, 1e3, 250e3), ("force", twist, 1e3, 500e3)):
        edges = np.geomspace(low, high, 20)
        for begin, end in itertools.pairwise(edges):
            bins = (f >= begin) & (f < end)
            ratio = np.mean(spectra[name][bins] / expected[bins])
            # Hann windows: 1.9 independent ones to a length, by overlap; 1.9 bins to an independent one.
            error = (bins.sum() * chunks * 2**3) ** -0.5
            # The scheme has 2/h tan(pi f h) in place of 2 pi f, and 1/cos^2 of it.
            assert ratio == pytest.approx(1.0, abs=4.0 * error + (math.pi * end * step) ** 2 / 3.0), (name, begin)


SHOWN = ("N", "F_x", "F_y", "shown", "tip", "delta")


def in_contact(b: LeverBench) -> dict[str, float]:
    """Variances of SHOWN of an upright lever whose tip sticks, by equipartition: springs of modes, contact and rest."""
    c, p, modes = b.plant.cantilever_numbers, b.p, b.plant.modes
    a, across = contact_under(b, c.k * 50e-9)
    along = 8.0 * b.plant.pair_numbers.G * a
    own = np.diag([c.k * x**4 / 12.0 for x in (1.8751040687, 4.6940911330, 7.8547574382)[:modes]])
    rest = np.array([[p.rest_yy, p.rest_yz], [p.rest_yz, p.rest_zz]])
    way = np.array([p.mode_y[:modes], p.mode_z[:modes]])
    held = np.linalg.inv(np.diag([1.0 / along, 1.0 / across]) + rest)
    modes_covariance = KT * np.linalg.inv(own + way.T @ held @ way)
    force = -held @ way
    rows = {
        "N": force[1],
        "F_y": force[0],
        "shown": p.mode_shown[:modes] + np.array([p.shown_y, p.shown_z]) @ force,
        "tip": p.mode_z[:modes] + np.array([p.rest_yz, p.rest_zz]) @ force,
        "delta": force[1] / across,
    }
    return {name: float(row @ modes_covariance @ row) for name, row in rows.items()}


@pytest.mark.parametrize(("step", "modes"), [(1e-6, 2), (2.5e-7, 2), (5e-7, 3)])
def test_what_a_tip_in_contact_shows_fluctuates_by_equipartition_whatever_the_step(step, modes):
    b = LeverBench(**UPRIGHT, plant__dt=step, plant__modes=modes, plant__temperature=295.0, plant__Q=10.0)
    n = round(0.1 / step)
    b.stay(n // 10)
    r = b.stay(n)
    assert r.stuck.all()
    for name, expected in in_contact(b).items():
        assert np.var(r[name]) == pytest.approx(expected, rel=0.05), name
    assert np.mean(r.N) == pytest.approx(10e-9, rel=1e-3)


@pytest.mark.parametrize(
    "values",
    [
        {"sample__kind": "plane", "sample__angle_x": 0.3, "sample__angle_y": -0.2, "plant__torsion": "moving"},
        {"sample__kind": "lattice", "sample__barrier": 3e-19, "plant__apex_mass": 4e-11, "plant__apex_damping": 1e6},
    ],
    ids=["slope", "lattice"],
)
def test_forces_on_a_slope_and_on_atoms_fluctuate_alike_at_steps_of_any_length(values):
    given = {"plant__scanner": "stack_13um", "plant__temperature": 295.0, "plant__Q": 10.0, "plant__Q_torsion": 10.0}
    found = []
    for step in (1e-6, 1e-7) if "sample__angle_x" in values else (2e-7, 5e-8):
        b = LeverBench(**(given | values), plant__dt=step)
        b.stay(round(0.01 / step))
        found.append(b.stay(round(0.1 / step)))
    for name in SHOWN:
        assert np.var(found[0][name]) == pytest.approx(np.var(found[1][name]), rel=0.06), name


def test_friction_shown_with_noise_keeps_to_its_bound_and_the_force_is_made_of_it():
    b = LeverBench(**UPRIGHT, plant__temperature=295.0)
    r = b.run(along(2e-6 * np.arange(1, 4001) * b.plant.dt))[1000:]
    assert 0.0 < np.mean(r.stuck) < 1.0
    assert (np.hypot(r.T_x, r.T_y) <= r.F_max * (1.0 + 1e-12)).all()
    assert r.F_x == pytest.approx(r.T_x)
    assert r.F_z == pytest.approx(r.N)


def test_noise_is_by_seed_and_none_at_zero_temperature():
    def deflection(**values: Any) -> np.ndarray:
        return LeverBench(**UPRIGHT, **values).stay(200).shown

    warm = {"plant__temperature": 295.0}
    assert np.ptp(deflection()) < 1e-18
    assert np.std(deflection(**warm)) > 1e-13
    assert (deflection(**warm) == deflection(**warm)).all()
    assert (deflection(**warm) != deflection(**warm, plant__seed=1)).any()
