"""Claims about what the contact of the plant `lever` takes: viscosity, liquid bridge, friction; docs/lever.md (47) to
(50).
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import CubicSpline

from afm_model import InstrumentParameters, ParameterError, build
from afm_model.plant import LEVER

from .lever_bench import BASE, LeverBench
from .test_lever import UPRIGHT, contact_under

QUIET = {"plant__tilt": 0.0, "plant__scanner": "stack_13um", "plant__modes": 1, "plant__tau": 1e3}
R, K, W = 10e-9, 2e9, 0.05
SOFT = QUIET | {"plant__lever": "ppp_fmr", "plant__dt": 5e-8, "plant__K": K, "plant__work_of_adhesion": W}
MODE = 1.0302
"""Stiffness of the first mode over the spring constant, 12 / x1^4 inverted."""


def ledger(b: LeverBench) -> Any:
    """What the contact of a bench has taken."""
    return b._layout.record(b.block, "plant_ledger")


def raised(z: np.ndarray) -> np.ndarray:
    """The sample raised by z, (n, 3)."""
    return np.column_stack([np.zeros((len(z), 2)), z])


def dmt(a: Any) -> tuple[Any, Any, Any, Any]:
    """Force and indentation, and their slopes over the contact radius."""
    return K * a**3 / R - 2.0 * math.pi * W * R, a**2 / R, 3.0 * K * a**2 / R, 2.0 * a / R


def jkr(a: Any) -> tuple[Any, Any, Any, Any]:
    """The same after Johnson, Kendall and Roberts."""
    pull = 6.0 * math.pi * W
    force, slope = K * a**3 / R - (pull * K * a**3) ** 0.5, 3.0 * K * a**2 / R - 1.5 * (pull * K * a) ** 0.5
    return force, a**2 / R - 2.0 / 3.0 * (pull * a / K) ** 0.5, slope, 2.0 * a / R - (pull / (a * K)) ** 0.5 / 3.0


def integrated(
    model: Callable[[Any], Any], c: Any, z: np.ndarray, h: float, start: float, eta: float, tau: float
) -> tuple[Any, float]:
    """Force in the middle of each step, and the energy taken, over a sample that is raised as z at the ends of the
    steps: one mode, a spring in series for the others, the contact's radius, and a viscous force that relaxes.
    """
    k1, rest, w0 = MODE * c.k, (1.0 - 1.0 / MODE) / c.k, 2.0 * math.pi * c.f0
    lift = CubicSpline(h * np.arange(len(z)), z)
    lifts = lift.derivative()
    radii = np.linspace(1e-9, 20e-9, 200_001)
    radii = radii[model(radii)[3] > 0.0]
    a0 = float(np.interp(start, model(radii)[0], radii))
    zero = start / c.k + model(a0)[1]

    def force(t: Any, q: Any, a: Any) -> Any:
        return (zero + lift(t) - z[0] - q - model(a)[1]) / rest

    def rate(t: float, y: Any) -> list[float]:
        q, v, a, _, S = y
        elastic, _, stiffer, deeper = model(a)
        N = force(t, q, a)
        mode = [v, w0**2 * (N / k1 - q) - w0 / c.Q * v]
        if tau == 0.0:
            dip = (N - elastic) / (eta * a)
            return [*mode, dip / deeper, eta * a * dip**2, 0.0]
        # N is elastic + S at any time; what leaves the contact takes its part of S along.
        hard, moved = eta / tau * a, float(lifts(t)) - v + rest * S / tau
        grows = moved / (deeper + rest * (stiffer + hard * deeper))
        if grows < 0.0:
            grows = moved / (deeper + rest * (stiffer + hard * deeper + S / a))
        change = hard * deeper * grows - S / tau + S * min(grows, 0.0) / a
        stored = S * change / hard - 0.5 * S**2 / (hard * a) * grows
        return [*mode, grows, S * deeper * grows - stored, change]

    t = h * (np.arange(len(z) - 1) + 0.5)
    begin, scale = [start / k1, 0.0, a0, 0.0, 0.0], [1e-14, 1e-9, 1e-15, 1e-24, 1e-14]
    found = solve_ivp(rate, (0.0, h * (len(z) - 1)), begin, method="Radau", t_eval=t, rtol=1e-8, atol=scale)
    return force(t, found.y[0], found.y[2]), float(found.y[3, -1])


@pytest.mark.parametrize(("eta", "tau"), [(500.0, 0.0), (2e4, 20e-6)], ids=["kelvin", "relaxing"])
@pytest.mark.parametrize("model", [dmt, jkr])
def test_force_curves_over_a_viscous_sample_at_two_rates_are_those_of_an_independent_integration(model, eta, tau):
    peaks = []
    for steps in (600, 6000):
        values = {"plant__contact": model.__name__, "plant__viscosity": eta, "plant__relaxation": tau}
        b = LeverBench(**SOFT, **values, reference__z_r=5e-9)
        c = b.plant.cantilever_numbers
        # 12 nm in and 8 nm out again, smoothly.
        into = 1.0 - np.cos(np.linspace(0.0, math.pi, steps))
        out = 1.0 - np.cos(np.linspace(0.0, math.pi, steps // 2))
        r = b.run(raised(np.concatenate([6e-9 * into, 12e-9 - 4e-9 * out])))
        z = np.concatenate([[r.Z[0]], r.Z])
        N, lost = integrated(model, c, z, b.plant.dt, 5e-9 * c.k, eta, tau)
        assert r.N == pytest.approx(N, abs=5e-5 * N.max())
        assert ledger(b).viscous == pytest.approx(lost, rel=1e-2, abs=0.0)
        peaks.append(N.max())
    # At the higher rate the sample is harder.
    assert peaks[0] > 1.03 * peaks[1]


@pytest.mark.parametrize("tilt", [0.0, 0.2])
@pytest.mark.parametrize("heat", [{}, {"plant__modes": 2}])
def test_viscosity_takes_nothing_from_a_tip_at_rest_and_changes_nothing(tilt, heat):
    values = {"plant__tilt": tilt, "plant__tau": 1e12} | heat
    plain, viscous = LeverBench(**values), LeverBench(**values, plant__viscosity=1e4)
    one, two = plain.stay(300), viscous.stay(300)
    assert two.N == pytest.approx(one.N, rel=1e-9, abs=0.0)
    assert two.tip == pytest.approx(one.tip, rel=1e-9, abs=0.0)
    assert 0.0 <= ledger(viscous).viscous < 1e-27


@pytest.mark.parametrize("dt", [1e-7, 1e-6])
def test_any_viscosity_is_stable_and_a_swing_ends_in_it(dt):
    for eta in (1e1, 1e3, 1e5, 1e8):
        b = LeverBench(plant__tilt=0.0, plant__dt=dt, plant__viscosity=eta, plant__tau=1e12)
        b.s.v[0] = 1e-3
        r = b.stay(round(1e-3 / dt))
        assert np.abs(r.N).max() < 1e-6
        assert ledger(b).viscous > 0.0


BRIDGE = {"plant__hamaker": 1e-22, "plant__work_of_adhesion": 1e-3, "plant__K": 50e9, "plant__contact": "dmt"}
VOLUME, TENSION = 1e-26, 0.072


def pulling(D: float) -> float:
    """Force of a bridge of this volume: Laplace's pressure under a meniscus of curvature 2 / height."""
    return 4.0 * math.pi * R * TENSION * (1.0 - D / math.sqrt(D * D + VOLUME / (math.pi * R)))


@pytest.mark.parametrize(("begin", "end"), [(0.0, 0.0), (0.8e-9, 1.5e-9)])
def test_area_between_the_branches_of_a_force_curve_is_the_work_of_the_bridge(begin, end):
    stiff = QUIET | BRIDGE | {"plant__k": 40.0, "plant__f0": 150e3, "plant__Q": 0.7, "plant__dt": 2.5e-7}
    bridge = {"plant__bridge_volume": VOLUME, "plant__bridge_begin": begin, "plant__bridge_end": end}
    b = LeverBench(**stiff, **bridge, plant__gap=3e-9)
    r = b.run(raised(np.concatenate([np.linspace(0.0, 3.2e-9, 20_000), np.linspace(3.2e-9, -1e-9, 25_000)])))
    work = quad(pulling, begin, end or VOLUME ** (1.0 / 3.0))[0]
    area = float(np.sum(0.5 * (r.N[1:] + r.N[:-1]) * np.diff(r.delta)))
    assert area == pytest.approx(work, rel=1e-2, abs=0.0)
    assert ledger(b).bridged == pytest.approx(work, rel=2e-3, abs=0.0)
    assert (ledger(b).bridge, ledger(b).viscous) == (0.0, 0.0)
    # On its own branch each way: in without, out with it.
    gap = np.maximum(r.end - r.delta, 0.0)
    inwards = np.flatnonzero(gap[:15_000] > begin + 0.1e-9)
    assert np.abs(r.N[inwards]).max() < 0.02 * pulling(0.0)
    outwards = 20_000 + np.flatnonzero((gap[20_000:] > 0.2e-9) & (gap[20_000:] < 1.3e-9))
    free = np.array([pulling(each) for each in gap[outwards]])
    assert -r.N[outwards] == pytest.approx(free, rel=2e-2, abs=0.0)


def test_a_tip_that_starts_in_contact_holds_a_bridge_under_the_load_asked_for():
    with_it = LeverBench(**QUIET, plant__bridge_volume=VOLUME)
    without = LeverBench(**QUIET)
    assert ledger(with_it).bridge == 1.0
    assert with_it.s.N == pytest.approx(without.s.N, rel=1e-9, abs=0.0)
    # It presses the tip into the sample: friction, by the area, is larger.
    assert with_it.s.F_max > 1.1 * without.s.F_max
    assert with_it.stay(100).N == pytest.approx(without.s.N, rel=1e-6, abs=0.0)


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_energy_of_friction_is_its_force_times_the_way_slid(slope):
    sample = {"sample__kind": "plane", "sample__angle_x": slope} if slope else {}
    b = LeverBench(**sample, plant__tilt=0.0, plant__modes=1)
    x = np.linspace(0.0, 100e-9, 40_000)
    r = b.run(np.column_stack([x, np.zeros((len(x), 2))]))
    # Along the surface: the horizontal way over the cosine of its slope.
    way = np.hypot(np.diff(r.A_x), np.diff(r.A_y)) / math.cos(slope)
    expected = float(np.sum(r.F_max[1:] * way * (r.stuck[1:] == 0.0)))
    assert r.stuck[-1] == 0.0
    assert expected > 0.0
    assert ledger(b).rubbed == pytest.approx(expected, rel=2e-3, abs=0.0)


@pytest.mark.parametrize("eta", [0.0, 1e3])
def test_a_warm_viscous_contact_fluctuates_by_the_heat_of_its_surroundings(eta):
    # Without the random force that belongs to it, viscosity would cool the cantilever.
    T = 295.0
    b = LeverBench(**UPRIGHT, plant__temperature=T, plant__viscosity=eta, plant__seed=3, plant__Q=10.0)
    c = b.plant.cantilever_numbers
    a, across = contact_under(b, float(b.s.N))
    along = 8.0 * b.plant.pair_numbers.G * a
    own = [c.k * x**4 / 12.0 for x in (1.8751040687, 4.6940911330)]
    rest = np.array([[b.p.rest_yy, b.p.rest_yz], [b.p.rest_yz, b.p.rest_zz]])
    way = np.array([b.p.mode_y[:2], b.p.mode_z[:2]])
    behind = way.T @ np.linalg.inv(np.diag([1.0 / along, 1.0 / across]) + rest) @ way
    expected = 1.380649e-23 * T * np.linalg.inv(np.diag(own) + behind)
    b.stay(20_000)
    found = [np.cov(b.stay(100_000).q[:, :2].T) for _ in range(8)]
    error = np.std(found, axis=0, ddof=1) / 8**0.5
    for i in range(2):
        assert error[i, i] < 0.05 * expected[i, i]
        assert np.mean(found, axis=0)[i, i] == pytest.approx(expected[i, i], abs=3.5 * error[i, i])


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"plant.viscosity": -1.0}, r"plant\.viscosity = -1\.0 Pa s is not allowed"),
        ({"plant.relaxation": 1e-6}, r"plant\.relaxation = 1e-06 has no effect with plant\.viscosity = 0"),
        ({"plant.bridge_end": 1e-9}, r"plant\.bridge_end = 1e-09 has no effect with plant\.bridge_volume = 0"),
        (
            {"plant.bridge_volume": 1e-27, "plant.bridge_begin": 2e-9},
            r"plant\.bridge_begin = 2e-09 m is not allowed: the bridge breaks at 1e-09 m, and must form nearer",
        ),
        (
            {"plant.viscosity": 1.0, "sample.kind": "lattice", "sample.barrier": 1e-19},
            r"plant\.viscosity = 1 is not allowed with sample\.kind = lattice",
        ),
        ({"plant.bridge_tension": 0.0}, r"plant\.bridge_tension = 0\.0 N/m is not allowed"),
    ],
)
def test_losses_that_cannot_be_are_refused_in_one_sentence(values, told):
    with pytest.raises(ParameterError, match=told):
        build(InstrumentParameters, BASE | values)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"plant.viscosity": 1e9}, "plant.viscosity = 1e+09 Pa s is implausible: usual are 0.001 to 1e+06 Pa s"),
        ({"plant.bridge_volume": 1e-23}, "the bridge is wider than the tip of plant.tip_radius = 1e-08 m"),
        ({"plant.viscosity": 100.0, "plant.bridge_volume": 1e-26}, None),
    ],
)
def test_losses_that_are_implausible_are_told(values, told):
    found = LEVER.warnings(build(InstrumentParameters, BASE | values))
    assert (found == []) if told is None else any(told in sentence for sentence in found)
