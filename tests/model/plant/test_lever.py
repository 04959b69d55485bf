"""Claims about the plant `lever`: friction loop, exact rest, slopes, resonances, energy; references of their own."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

from afm_model import Instrument, InstrumentParameters, build
from afm_model.contact.maugis import branch

from .beam_elements import ElementBeam
from .lever_bench import BASE, LeverBench, triangle

STIFF = {"plant__scanner": "stack_13um"}
UPRIGHT = STIFF | {"plant__tilt": 0.0}


def along(x: np.ndarray, axis: int = 0) -> np.ndarray:
    """Way of the scanner along one axis, (n, 3)."""
    moved = np.zeros((len(x), 3))
    moved[:, axis] = x
    return moved


def series(*stiffness: float) -> float:
    """Stiffness of springs one behind the other."""
    return 1.0 / sum(1.0 / k for k in stiffness)


@cache
def exact_contact(contact: str, transition: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Contact radius, force, stiffness on the branch that is stable under a load, by the exact equations."""
    exact = branch(contact, transition)
    s = np.linspace(0.0, 4.0, 4000)
    d = exact.least_indentation + s * s
    a, force = exact.solve(d)
    after = int(np.argmin(force)) + 1
    return a[after:], force[after:], np.gradient(force, d)[after:]


def contact_under(b: LeverBench, load: float) -> tuple[float, float]:
    """Contact radius [m] and normal stiffness [N/m] under a load [N]; interpolated to 1e-6."""
    a, force, stiffness = exact_contact(b.plant.contact, b.plant.transition)
    units, at = b.plant.contact_units, load / b.plant.contact_units.force
    radius = float(np.interp(at, force, a)) * units.radius
    return radius, float(np.interp(at, force, stiffness)) * units.force / units.indentation


def test_friction_loop_on_silicon_oxide_has_the_slope_of_the_springs_in_series_and_the_width_of_friction():
    b = LeverBench(**UPRIGHT)
    c, pair = b.plant.cantilever_numbers, b.plant.pair_numbers
    load = c.k * 50e-9
    assert load == pytest.approx(10e-9)
    a, _ = contact_under(b, load)
    k_contact = 8.0 * pair.G * a
    k_torsion = c.k_torsion / (c.tip_height + 0.5 * c.thickness) ** 2
    expected = series(k_torsion, c.k * (c.width / c.thickness) ** 2, k_contact)
    r = b.run(along(triangle(3e-9, 4000)))
    sticking = r[:50]
    assert sticking.stuck.all()
    # Forces are those of mid-step.
    middle = 0.5 * (sticking.X[:-1] + sticking.X[1:])
    slope = np.diff(sticking.F_x[1:]) / np.diff(middle)
    assert slope[10:] == pytest.approx(expected, rel=1e-3)
    friction = pair.tau * math.pi * a**2
    second = r[4000:]
    sliding = second[second.stuck == 0.0]
    half_width = 0.5 * (sliding.F_x.max() - sliding.F_x.min())
    assert half_width == pytest.approx(friction, rel=2e-4)
    # Turning points: the tip sticks over a fraction of a nanometre.
    stuck_way = 2.0 * friction / expected
    assert 0.1e-9 < stuck_way < 1e-9
    assert np.ptp(second.X[second.stuck == 1.0][:2000]) > 0.0


def test_friction_loop_is_that_of_the_play_operator_at_every_step():
    # Springs in series and a constant bound: a closed form, whatever the path.
    b = LeverBench(**UPRIGHT)
    c, pair = b.plant.cantilever_numbers, b.plant.pair_numbers
    a, _ = contact_under(b, c.k * 50e-9)
    k = series(c.k_torsion / (c.tip_height + 0.5 * c.thickness) ** 2, c.k_in_plane, 8.0 * pair.G * a)
    bound = pair.tau * math.pi * a**2
    n = 6000
    t = np.arange(n) * 1e-6
    way = 1e-9 * np.sin(2.0 * np.pi * 400.0 * t) + 0.4e-9 * np.sin(2.0 * np.pi * 1130.0 * t)
    r = b.run(along(way))
    middle = 0.5 * (np.concatenate([[0.0], r.X[:-1]]) + r.X)
    force, play = 0.0, []
    before = 0.0
    for x in middle:
        force = min(max(force + k * (x - before), -bound), bound)
        before = x
        play.append(force)
    assert 0.2 < r.stuck.mean() < 0.8
    # The contact radius under this load is known to 1e-5.
    assert r.F_x == pytest.approx(np.array(play), abs=1e-4 * bound)


def test_a_stuck_tip_holds_its_place_on_the_sample_to_the_last_bit():
    b = LeverBench(**STIFF, sample__kind="plane", sample__angle_x=0.3, sample__angle_y=-0.2)
    # Within the bound: 0.05 nm of 0.3.
    n = 4000
    r = b.run(along(0.05e-9 * np.sin(2.0 * np.pi * 500.0 * np.arange(n) * 1e-6)))
    assert r.stuck.all()
    assert np.ptp(r.F_x) > 1e-10
    for name in ("A_x", "A_y"):
        assert len(set(r[name].tolist())) == 1


def test_a_tip_left_alone_after_sliding_comes_to_rest_and_stays_there():
    b = LeverBench(**STIFF)
    b.run(along(np.linspace(0.0, 3e-9, 600)))
    assert b.s.stuck == 0.0
    r = b.run(np.tile([2.5e-9, 0.0, 0.0], (30_000, 1)))
    assert r.stuck[-20_000:].all()
    assert len(set(r.A_x[-20_000:].tolist())) == 1
    # What is left of the motion: the cantilever's ring-down, e-fold 40 / (pi 26 kHz) = 0.49 ms in air.
    assert np.abs(r.v[-100:]).max() < 1e-12


@pytest.mark.parametrize("lever", ["ppp_lfmr", "contal_g", "snl_10b"])
def test_free_cantilever_rings_at_f0_and_decays_by_its_quality_factor(lever):
    b = LeverBench(plant__lever=lever, plant__gap=1e-6, plant__modes=1)
    c = b.plant.cantilever_numbers
    b.s.v[0] = 1e-4
    v = np.concatenate([[1e-4], b.stay(30_000).v[:, 0]])
    # x_n = 2 r cos(w h) x_{n-1} - r^2 x_{n-2}: two unknowns by least squares.
    twice, square = np.linalg.lstsq(np.column_stack([v[1:-1], -v[:-2]]), v[2:], rcond=None)[0]
    radius = math.sqrt(square)
    omega = math.acos(twice / (2.0 * radius)) / 1e-6
    # Damped resonance: 1 - 1/(8 Q^2); the scheme's own is exact without damping.
    assert omega / (2.0 * math.pi) == pytest.approx(c.f0 * math.sqrt(1.0 - 0.25 / c.Q**2), rel=1e-5)
    # (omega h)^2 / 4 = 0.5 % of the scheme.
    assert -math.log(radius) / 1e-6 == pytest.approx(0.5 * 2.0 * math.pi * c.f0 / c.Q, rel=7e-3)


def test_free_scanner_answers_a_step_of_each_drive_by_that_axis_alone_as_an_oscillator_of_its_own():
    f = {"plant__f_x": 500.0, "plant__f_y": 700.0, "plant__f_z": 4000.0}
    b, n, moved = LeverBench(plant__gap=1e-6, **f), 5000, np.array([3e-9, -5e-9, 7e-9])
    Q, start = b.plant.scanner_numbers.Q, (float(b.s.X), float(b.s.Y), float(b.s.Z))
    s, t = b.run(np.tile(moved, (n, 1))), 1e-6 * np.arange(1, n + 1)
    for axis, (place, frequency) in enumerate(zip((s.X, s.Y, s.Z), f.values(), strict=True)):
        omega, xi = 2.0 * math.pi * frequency, 0.5 / Q
        damped = omega * math.sqrt(1.0 - xi**2)
        settling = np.exp(-xi * omega * t) * (np.cos(damped * t) + xi * omega / damped * np.sin(damped * t))
        # The scheme's frequency is exact without damping: 4e-7, 1e-6 and 4e-5 are left, a quarter at half the step.
        within = 3e-6 if axis < 2 else 1e-4
        assert place - start[axis] == pytest.approx(moved[axis] * (1.0 - settling), abs=within * abs(moved[axis]))


def one_step_map(b: LeverBench) -> np.ndarray:
    """Linear map of one step on the bending modes about rest, (deflection, rate over 2 pi f0) of each."""
    b.stay(2)
    rest, n = b.numbers.copy(), b.plant.modes
    w = 2.0 * math.pi * b.plant.cantilever_numbers.f0
    size = 1e-15
    columns = []
    for j in range(2 * n):
        ends = []
        for sign in (1.0, -1.0):
            b.numbers[:] = rest
            if j < n:
                b.s.q[j] += sign * size
            else:
                b.s.v[j - n] += sign * size * w
            b.stay(1)
            ends.append(np.concatenate([b.s.q[:n], b.s.v[:n] / w]))
        columns.append((ends[0] - ends[1]) / (2.0 * size))
    b.numbers[:] = rest
    return np.array(columns).T


@pytest.mark.parametrize(
    ("values", "first", "second"),
    [
        ({}, 0.02, None),
        ({"plant__dt": 2.5e-7}, 1e-3, None),
        ({"plant__dt": 2.5e-7, "plant__modes": 3}, 1e-3, 6e-3),
        ({"plant__lever": "contal_g"}, 4e-3, None),
    ],
    ids=["default", "finer", "finer, three modes", "contal_g"],
)
@pytest.mark.parametrize("tilt", [0.0, 0.2])
def test_contact_resonances_of_a_stuck_tip_are_those_of_finite_elements_on_springs(values, first, second, tilt):
    b = LeverBench(**STIFF | values | {"plant__Q": 1e6, "plant__tilt": tilt})
    c = b.plant.cantilever_numbers
    a, normal = contact_under(b, float(b.s.N))
    tangential = 8.0 * b.plant.pair_numbers.G * a
    arm = c.tip_height + 0.5 * c.thickness
    # The tip moves by (arm slope, deflection) along and across the cantilever, which is turned by the tilt.
    turn = np.array([[math.cos(tilt), math.sin(tilt)], [-math.sin(tilt), math.cos(tilt)]])
    of_end = turn @ np.array([[0.0, arm], [1.0, 0.0]])
    spring = of_end.T @ np.diag([tangential, normal]) @ of_end
    exact = ElementBeam(c.k, c.length, c.f0).frequencies(spring)
    eigenvalues = np.linalg.eigvals(one_step_map(b))
    found = np.sort(np.abs(np.angle(eigenvalues)))[::2] / (2.0 * math.pi * b.plant.dt)
    assert found[0] == pytest.approx(exact[0], rel=first)
    if second is not None:
        assert found[1] == pytest.approx(exact[1], rel=second)
    # Stable, and no damping but that of Q = 1e6.
    assert np.abs(eigenvalues) == pytest.approx(1.0, abs=1e-6)
    assert np.abs(eigenvalues).max() < 1.0 + 1e-9


@pytest.mark.parametrize("tilt", [0.0, 0.2, -0.3])
def test_static_deflection_is_that_of_finite_elements_under_a_tilted_force(tilt):
    b = LeverBench(plant__tilt=tilt, **STIFF)
    c = b.plant.cantilever_numbers
    arm = c.tip_height + 0.5 * c.thickness
    beam = ElementBeam(c.k, c.length, c.f0)
    # A vertical force, in the cantilever's frame: couple by its part along, force by its part across.
    N = float(b.s.N)
    end, slope = beam.compliance() @ np.array([N * math.cos(tilt), -N * math.sin(tilt) * arm])
    assert b.s.tip == pytest.approx(math.cos(tilt) * end - math.sin(tilt) * arm * slope, rel=1e-9)
    # The photodiode sees the slope, counted as the deflection that an end force of that slope would make: the setpoint.
    assert 2.0 / 3.0 * c.length * slope == pytest.approx(50e-9, rel=1e-9)
    assert b.s.shown == pytest.approx(50e-9, rel=1e-12)
    # And the force of it is that of the setpoint of this force.
    assert b.plant.deflection_under(b.parameters, N) == pytest.approx(50e-9, rel=1e-9)


def test_friction_along_the_cantilever_bends_it():
    # A stuck, upright tip pushed along y: what is shown changes by 2 arm / L of the force over k, less what the contact
    # takes back by pulling on the end.
    b = LeverBench(**UPRIGHT)
    c = b.plant.cantilever_numbers
    r = b.run(along(np.concatenate([np.linspace(0.0, 0.05e-9, 4000), np.full(8000, 0.05e-9)]), axis=1))
    assert r.stuck.all()
    arm = c.tip_height + 0.5 * c.thickness
    beam = ElementBeam(c.k, c.length, c.f0)
    F_y, dN = float(r.F_y[-1]), float(r.N[-1] - r.N[0])
    assert F_y > 5e-10
    _, slope = beam.compliance() @ np.array([dN, F_y * arm])
    assert r.shown[-1] - r.shown[0] == pytest.approx(2.0 / 3.0 * c.length * slope, rel=1e-4)
    assert abs(r.shown[-1] - r.shown[0]) > 10.0 * abs(r.tip[-1] - r.tip[0])


@pytest.mark.parametrize("angle", [0.2, 0.6, 0.95])
def test_friction_loop_on_a_slope_follows_the_closed_forms_of_a_wedge(angle):
    b = LeverBench(**STIFF, sample__kind="plane", sample__angle_x=angle, plant__tilt=0.0, reference__z_r=60e-9)
    s, c = math.sin(angle), math.cos(angle)
    r = b.run(along(triangle(2e-9, 20_000)))
    sliding = r[(r.stuck == 0.0) & (np.arange(len(r)) > 20_000)]
    for way in (1.0, -1.0):
        half = sliding[way * sliding.S_x > 0.0]
        assert len(half) > 1000
        # Force and moment balance at the slope: N and friction from what the cantilever pushes with.
        N = c * half.F_z + s * half.F_x
        friction = way * (c * half.F_x - s * half.F_z)
        assert half.N == pytest.approx(N, rel=1e-6)
        # Area friction of the exact contact under that normal force.
        for i in (0, len(half) // 2, -1):
            a, _ = contact_under(b, float(N[i]))
            expected = b.plant.pair_numbers.tau * math.pi * a**2
            # As the load grows the tip, which stands below the cantilever, slides along it as well.
            assert np.hypot(friction[i], half.F_y[i]) == pytest.approx(expected, rel=1e-4)
            # T = (L s +- F) / c up and down, with F from the load: Ogletree's form of it.
            assert half.F_x[i] == pytest.approx((half.F_z[i] * s + way * expected) / c, rel=1e-2)


def test_friction_opposes_sliding_in_every_direction_with_the_same_size():
    b = LeverBench(**STIFF)
    n = 20_000
    angle = 2.0 * np.pi * np.arange(n) / n
    r = b.run(2e-9 * np.column_stack([np.cos(angle) - 1.0, np.sin(angle), np.zeros(n)]))
    sliding = r[n // 4 :]
    assert not sliding.stuck.any()
    size = np.hypot(sliding.T_x, sliding.T_y)
    assert size == pytest.approx(sliding.F_max, rel=1e-9)
    # Along the way of the place under the tip; a spring that turns with it slides as well.
    cosine = (sliding.T_x * sliding.S_x + sliding.T_y * sliding.S_y) / (size * np.hypot(sliding.S_x, sliding.S_y))
    assert cosine.min() > 0.99


@pytest.mark.parametrize("speed", [1e-7, 1e-6, 1e-4])
def test_friction_grows_with_the_logarithm_of_the_velocity(speed):
    b = LeverBench(**UPRIGHT, plant__strengthening=0.08, plant__slow=3e-7)
    bound = float(b.s.F_max)
    # To the edge of sliding, then steadily.
    b.run(along(np.linspace(0.0, 0.3e-9, 2000)))
    n = 4000
    r = b.run(along(0.3e-9 + speed * 1e-6 * np.arange(1, n + 1)))
    expected = bound * (1.0 + 0.08 * math.log(1.0 + speed / 3e-7))
    assert r.F_x[-100:] == pytest.approx(expected, rel=1e-3)
    assert r.stuck[-1] == 0.0


def test_rest_is_exact_with_friction_that_grows_with_the_velocity():
    b = LeverBench(**STIFF, plant__strengthening=0.1, plant__slow=1e-9)
    b.run(along(np.linspace(0.0, 1e-9, 1000)))
    r = b.run(np.tile([0.8e-9, 0.0, 0.0], (20_000, 1)))
    assert r.stuck[-10_000:].all()
    assert len(set(r.A_x[-10_000:].tolist())) == 1


def energy(b: LeverBench, r: Any) -> np.ndarray:
    """Of the bending modes [J]; without contact and static springs."""
    total = np.zeros(len(r))
    for i in range(b.plant.modes):
        w2 = b.p.mode_w2[i]
        k = b.p.half * w2 * b.p.mode_inverse[i] / b.p.mode_push[i]
        total += 0.5 * k * (r.q[:, i] ** 2 + r.v[:, i] ** 2 / w2)
    return total


def test_a_struck_tip_in_contact_loses_energy_and_never_gains():
    b = LeverBench(sample__kind="plane", sample__angle_x=0.4, sample__angle_y=0.3, **STIFF)
    b.stay(10)
    b.s.v[0] += 2e-3
    b.s.v[1] -= 3e-3
    r = b.stay(20_000)
    # Springs give back what they took within a swing: compare the largest of each millisecond.
    largest = energy(b, r).reshape(20, -1).max(axis=1)
    assert (np.diff(largest) < 1e-12 * largest[0]).all()
    assert np.ptp(r.v[-100:, 0]) < 1e-3 * np.ptp(r.v[:100, 0])


def test_slow_sliding_is_smooth_at_every_speed():
    # A direction of friction that is not exact drives the tip: the slower, the more. Load within round-off of itself.
    for speed in (1e-4, 1e-6, 1e-8):
        b = LeverBench(**STIFF)
        b.run(along(np.linspace(0.0, 0.6e-9, 3000)))
        n = 3000
        r = b.run(along(0.6e-9 + speed * 1e-6 * np.arange(1, n + 1)))
        assert np.ptp(r.N[n // 2 :]) < 2e-4 * r.N[-1]
        assert not r.stuck[-10:].any() or speed < 1e-7


def end_of_slide(h: float) -> Any:
    """State after sliding over a slope under a load that changes; bending nearly critically damped."""
    slope = {"sample__kind": "plane", "sample__angle_x": 0.3, "sample__angle_y": 0.1}
    b = LeverBench(**STIFF, **slope, plant__dt=h, plant__Q=0.6, reference__z_r=100e-9)
    n = round(1.6e-4 / h)
    w, t = 2.0 * math.pi * 3e3, (np.arange(n) + 0.5) * h
    b.s.V_X = 4e-9 * w
    return b.run(4e-9 * np.column_stack([np.sin(w * t), 1.0 - np.cos(w * t), 0.5 * np.sin(1.3 * w * t)]))[-1]


def test_order_is_two_for_the_scanner_and_one_in_slip_with_half_a_step_of_delay():
    fine = end_of_slide(1e-6 / 64.0)
    ends = [end_of_slide(h) for h in (1e-6, 5e-7, 2.5e-7)]
    scanner = [abs(each.X - fine.X) for each in ends]
    tip = [abs(each.q[0] - fine.q[0]) for each in ends]
    assert np.log2(np.array(scanner[:-1]) / scanner[1:]) == pytest.approx(2.0, abs=0.1)
    assert np.log2(np.array(tip[:-1]) / tip[1:]) == pytest.approx(1.0, abs=0.25)
    # At the default step 1e-3 of the motion, of a nanometre, at 3 kHz.
    assert tip[0] < 1.5e-12


def test_the_instrument_reads_deflection_from_slope_and_lateral_force_from_torsion():
    values = {name.replace("__", "."): value for name, value in STIFF.items()}
    channels = {"detector.channels": "truth/lateral_force, truth/torsion, truth/place_x"}
    parameters = build(InstrumentParameters, BASE | values | channels)
    scope = Instrument(parameters, 200)
    c = parameters.plant.cantilever_numbers
    drive = np.array(scope.drive)
    for _ in range(150):
        drive[0] += 0.02e-9 / 20e-9
        scope.tick(drive)
    block = scope.take_block()
    read = {each.name: each.scale(parameters) * row for each, row in zip(scope.channels, block.samples, strict=True)}
    force = read["truth/lateral_force"]
    assert np.ptp(force) > 1e-9
    assert read["lateral_force"] == pytest.approx(force, rel=1e-12)
    arm = c.tip_height + 0.5 * c.thickness
    assert read["truth/torsion"] == pytest.approx(force * arm / c.k_torsion, rel=1e-12)
    state = scope.state
    assert scope.measurement[0] == pytest.approx(state.shown, rel=1e-12)
    assert scope.truth.tip_height == pytest.approx(state.tip, rel=1e-12)
