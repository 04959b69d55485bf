"""Claims about the gains of the friction-predicting law, against independent references."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from law_bounds import (
    AMPLITUDE,
    SPEED,
    constants,
    of_drift,
    of_edges,
    of_loop,
    of_surface,
    radius,
    tables,
)
from law_noise import RATES, uncertainties, with_noise
from law_noise import tables as tables_of_noise
from law_pages import page_of
from make_docs import between_marks

from afm_model import ControllerParameters, SimParameters, build, simulate
from afm_predictive.gains import Grid, gains, grid, observer_gains, transition

ETA = {"x": 0.42039, "y": 0.25577, "z": 0.43111}
XI = {"x": 0.0366, "y": 0.0293, "z": 0.0410}
AXES = [(ETA[axis] ** 2, 2.0 * XI[axis] * ETA[axis]) for axis in "xyz"]
HOLDS = [0.02, 0.5, 1.0, 2.0, 2.5, 5.0, 7.0, 10.0]


@pytest.mark.parametrize(("stiffness", "damping"), AXES)
def test_transition_is_that_of_the_differential_equation(stiffness, damping):
    def rate(t, q):
        return [q[1], 0.7 - stiffness * q[0] - damping * q[1]]

    Phi, Gamma = transition(stiffness, damping, 2.0)
    expected = solve_ivp(rate, (0.0, 2.0), [1.3, -0.4], rtol=1e-11, atol=1e-12).y[:, -1]
    assert pytest.approx(expected, abs=1e-9) == Phi @ [1.3, -0.4] + Gamma * 0.7


@pytest.mark.parametrize(
    ("hold", "expected"),
    [(0.02, Grid(2, 8, 0.04)), (0.5, Grid(2, 8, 1.0)), (2.0, Grid(4, 8, 3.2)), (10.0, Grid(20, 8, 10.0))],
)
def test_horizon_and_response_follow_from_the_hold(hold, expected):
    assert grid(hold, 0.0) == expected


def test_a_longer_response_has_a_longer_horizon():
    assert grid(0.5, 4.0) == Grid(2, 32, 4.0)


def test_drives_of_a_packet_are_divided_finer():
    # They are decided on one measurement, most of them far ahead.
    assert grid(0.5, 0.0, packet=20) == Grid(4, 8, 1.0)


def cost(drives, e, asked, stiffness, damping, hold, division):
    """What the gains are to make small, by stepping the error interval by interval."""
    fine, holds, T = division
    Phi, Gamma = transition(stiffness, damping, hold / fine)
    rows = []
    for k in range(holds):
        mean = np.mean([asked[k * fine + j][1] / Gamma[1] for j in range(fine)])
        for j in range(fine):
            e = Phi @ e + Gamma * drives[k] - asked[k * fine + j]
            rows.append(e[0])
        rows.append(math.sqrt(fine * T**4) * (drives[k] - mean))
    return np.array(rows)


@pytest.mark.parametrize(("stiffness", "damping"), AXES)
@pytest.mark.parametrize("hold", [0.5, 2.0])
def test_the_drive_is_the_first_of_the_least_squares_solution(stiffness, damping, hold, rng):
    division = grid(hold, 0.0)
    made = gains(stiffness, damping, hold, division)
    e, asked = rng.normal(size=2), rng.normal(size=(division.fine * division.holds, 2))
    # The cost is the square of an affine function: its matrix column by column, solved by QR.
    rest = cost(np.zeros(division.holds), e, asked, stiffness, damping, hold, division)
    matrix = np.array(
        [cost(unit, e, asked, stiffness, damping, hold, division) - rest for unit in np.eye(division.holds)]
    ).T
    expected = np.linalg.lstsq(matrix, -rest, rcond=None)[0][0]
    assert -made.K @ e + np.sum(made.G * asked) == pytest.approx(expected, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize(("stiffness", "damping"), AXES)
@pytest.mark.parametrize("hold", HOLDS)
def test_a_reference_that_a_held_drive_can_follow_is_followed_exactly(stiffness, damping, hold):
    division = grid(hold, 0.0)
    made = gains(stiffness, damping, hold, division)
    asked = np.tile(made.Gamma * 3.0, (division.fine * division.holds, 1))
    # The path of a constant drive of 3 asks for Gamma 3 in each interval.
    assert np.sum(made.G * asked) == pytest.approx(3.0, rel=1e-9)


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("late", [0, 1])
def test_the_loop_bears_a_drive_that_is_one_period_late(hold, late):
    assert radius(1e-4 * hold, late) < 1.0


def test_radius_is_how_fast_the_error_decays():
    p = constants(2e-4)
    e, before, kept = np.array([1.0, 0.0]), 0.0, []
    Phi, Gamma = transition(p["stiffness"][1], p["damping"][1], p["slot"])
    for _ in range(400):
        e, before = Phi @ e + Gamma * before, -p["K"][1] @ e
        kept.append(np.linalg.norm(e))
    assert (kept[-1] / kept[99]) ** (1.0 / 300.0) <= radius(2e-4, 1) + 0.01 < 1.0


def test_what_a_surface_leaves_falls_with_the_period():
    friction, error, at_most = of_surface(2e-4, 1)
    assert of_surface(2e-5, 1)[1] < 0.02 * error
    assert friction < 0.5 * of_surface(1e-3, 1)[0] < 0.5
    # Nothing that the law has found out is below what can be known: 0.2 % is its largest error.
    assert error < at_most < 0.2
    # Where friction is stronger an error pushes away.
    assert of_surface(1e-3, 1, 2.0)[1] > 6.0 * of_surface(1e-3, 1)[1]


@pytest.mark.parametrize(("period", "strength", "wander"), [(5e-5, 2.0, False), (2e-4, 1.5, True)])
def test_bound_of_noise_is_what_all_measurements_of_two_waves_leave(period, strength, wander):
    p = constants(period, 1, feedback="measured")
    q, h, half = 2.0 * p["wave_number"] / math.sqrt(2.0), p["hold"], 0.5 * p["height"]
    stiffness, damping = p["stiffness"][:2].mean(), p["damping"][:2].mean()

    def friction(x):
        # Where a wave is high the load is greater, and the surface bent.
        return strength * p["f_0"] * (p["eta_c2"] * p["f_load"] - p["ripple"] / p["height"]) * half * math.sin(q * x)

    def rate(t, y, begins):
        x, v, of_surface, its_rate, _, slope, another = y.reshape(7, 7)
        at = SPEED * (begins + t)
        held = (friction(at + 1e-4) - friction(at - 1e-4)) / 2e-4
        height = half * q * math.cos(q * at) * v + SPEED * slope
        pushed = -(stiffness + held) * x - damping * v - of_surface - another
        none = np.zeros(7)
        return np.ravel([v, pushed, its_rate, none, height, none, none])

    wave = round(2.0 * math.pi / (q * SPEED * h))
    # Of the seven states side by side.
    steps = [
        solve_ivp(rate, (0.0, h), np.eye(7).ravel(), args=(k * h,), rtol=1e-8).y[:, -1].reshape(7, 7)
        for k in range(wave)
    ]
    # What a period adds: friction and height bend as much as those of the shortest wave at its top.
    bend_f, bend_h = strength * p["f_0"] * p["ripple"] * (q * SPEED) ** 2, half * q * q * SPEED * h
    adds = np.zeros((7, 3))
    adds[2:4, 0] = 0.5 * h * h * bend_f, h * bend_f
    adds[4:6, 1] = 0.5 * SPEED * h * bend_h, bend_h
    # And what gain and slow force wander by.
    gain, slow, *_ = np.sqrt(p["walk"][0])
    adds[6, 2] = wander * math.hypot(gain * strength * p["f_0"], slow)
    of_height = math.hypot(p["height_noise"], p["z_noise"])
    noise = np.array([p["position_noise"], math.sqrt(2.0) * p["force_noise"], of_height])
    # The state at each measurement as the sum of what was there at first and what each period has added.
    state, told, squares = np.diag([*6 * (1.0,), float(wander)]), np.eye(7), []
    for k in range(3 * wave):
        state = np.hstack([steps[k % wave] @ state, adds])
        seen = state[[0, 2, 4]] / noise[:, None]
        told = block_diag(told, np.eye(3)) + seen.T @ seen
        if k < 2 * wave:
            continue
        later, more = state, []
        for j in (1, 2):
            later, more = steps[(k + j) % wave] @ later, [steps[(k + j) % wave] @ each for each in more] + [adds]
        of_more = sum(np.square(each[0]).sum() for each in more)
        left = np.linalg.solve(told, np.column_stack([state[0], later[0]]))
        squares.append((state[0] @ left[:, 0], later[0] @ left[:, 1] + of_more))
    of_estimate, of_later = np.array(squares).T
    percent = 100.0 / (AMPLITUDE * math.sqrt(2.0))
    expected = math.sqrt(of_estimate.mean()), math.sqrt(of_later.mean()), math.sqrt(of_later.max())
    assert uncertainties(period, 1, strength, wander) == pytest.approx(percent * np.array(expected), rel=0.03)


@pytest.mark.parametrize(
    ("knows", "period", "strength", "wander"),
    [("known", 1e-3, 1.5, True), ("learned", 1e-3, 1.0, True), ("observed", 1e-3, 1.5, False)],
)
def test_bound_of_noise_without_shorter_waves_is_that_of_the_differential_equation(knows, period, strength, wander):
    p = constants(period, 1, feedback="measured", packet=20)
    h, size, f = p["hold"], p["height"], strength * p["f_0"]
    q, omega = 2.0 * p["wave_number"] / math.sqrt(2.0), SPEED / (AMPLITUDE * math.sqrt(2.0))
    stiffness, damping = p["stiffness"][:2].mean(), p["damping"][:2].mean()
    waves, cycles = (0 if knows == "known" else 24), {"known": 2, "learned": 3, "observed": 4}[knows]
    k, none = (np.arange(waves) + 0.5) / max(waves, 1), np.zeros(3 if wander else 0)

    def place(t):
        return SPEED * t if knows == "observed" else SPEED / omega * math.sin(omega * t)

    def height(x):
        return np.concatenate([np.cos(k * q * x), np.sin(k * q * x)])

    def friction(x):
        # By the load, and by the curvature of the surface.
        bent = np.concatenate([k, k]) ** 2 * height(x)
        return f * (p["eta_c2"] * p["f_load"] * height(x) - p["ripple"] / size * bent)

    def told(x):
        return 0.5 * size * math.sin(q * x)

    def told_friction(x):
        return f * (p["eta_c2"] * p["f_load"] - p["ripple"] / size) * told(x)

    def slope(of, x):
        return (of(x + 1e-4) - of(x - 1e-4)) / 2e-4

    def rate(t, y):
        # Error and its rate, by their first values and by each wave.
        e, v = y.reshape(2, -1)
        sense = 1.0 if knows == "observed" else math.copysign(1.0, math.cos(omega * t))
        held = np.concatenate([[0.0, 0.0], friction(place(t)), none]) + slope(told_friction, place(t)) * e
        # Gain of friction, slow force, stiffness.
        held[len(held) - none.size :] += np.array([f, sense, sense * place(t)])[: none.size]
        return np.ravel([v, -stiffness * e - damping * v - sense * held])

    count = round((8.0 * math.pi / (q * SPEED) if knows == "observed" else cycles * 2.0 * math.pi / omega) / h)
    size_of = 2 + 2 * waves + none.size
    steps = np.tile(np.eye(size_of), (count + 2, 1, 1))
    for i in range(count + 2):
        end = solve_ivp(rate, (h * i, h * (i + 1)), np.eye(size_of)[:2].ravel(), rtol=1e-5, atol=1e-8).y[:, -1]
        steps[i, :2] = end.reshape(2, -1)
    of_waves = np.full(2 * waves, size**2 / (8.0 * max(waves, 1)))
    P = np.diag([p["position_noise"] ** 2, 0.01, *of_waves, *np.square(p["first"][0][: none.size])])
    walks = np.diag([*np.zeros(2 + 2 * waves), *p["walk"][0][: none.size]])
    noise = p["position_noise"], math.hypot(p["height_noise"], p["z_noise"]), math.sqrt(2.0) * p["force_noise"]
    left = []
    for i in range(count):
        P, x = steps[i] @ P @ steps[i].T + walks, place(h * (i + 1))
        # Position, height and friction are measured at once.
        H = np.zeros((3, len(P)))
        H[:, 0] = 1.0, slope(told, x), slope(told_friction, x)
        H[1:, 2 : 2 + 2 * waves] = height(x), friction(x)
        gain = np.linalg.solve(H @ P @ H.T + np.diag(np.square(noise)), H @ P).T
        rest = np.eye(len(P)) - gain @ H
        P = rest @ P @ rest.T + (gain * np.square(noise)) @ gain.T
        later = (steps[i + 2] @ steps[i + 1])[0]
        left.append(later @ P @ later)
    expected = 300.0 * math.sqrt(max(left[-(count // cycles) :])) / (AMPLITUDE * math.sqrt(2.0))
    assert with_noise(period, 1, strength, knows, wander) == pytest.approx(expected, rel=0.02)


def test_what_a_surface_leaves_is_what_drawn_surfaces_leave_whose_mean_is_foreseen():
    p, rng = constants(1e-3, 1, packet=20), np.random.default_rng(5)
    strength, waves, size = 1.5, 40, 300
    rate = 2.0 * p["wave_number"] * SPEED / math.sqrt(2.0)
    k = (np.arange(waves) + 0.5) / waves
    drawn = rng.normal(size=(2 * waves, size)) * p["height"] / math.sqrt(8.0 * waves)

    def heights(t, curved=False):
        sizes = np.square(k) if curved else np.ones(waves)
        return np.hstack([np.cos(np.outer(rate * t, k)) * sizes, np.sin(np.outer(rate * t, k)) * sizes])

    seen = -p["hold"] * np.arange(40)
    by_curvature = p["ripple"] / p["height"]
    told = np.vstack([heights(seen), by_curvature * heights(seen, True)])
    noise = np.repeat([p["height_noise"], p["ratio_noise"]], seen.size)
    # Least squares with the prior as further measurements of zero.
    A = np.vstack([told / noise[:, None], np.eye(2 * waves) * math.sqrt(8.0 * waves) / p["height"]])
    measured = (told @ drawn + rng.normal(size=(noise.size, size)) * noise[:, None]) / noise[:, None]
    found = np.linalg.lstsq(A, np.vstack([measured, np.zeros_like(drawn)]), rcond=None)[0]
    # The error under the drive for what was found, friction and load at the place where the tip is.
    f, by_load = strength * p["f_0"], p["eta_c2"] * p["f_load"]
    places, h = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)[:, None], 0.01
    e, v = np.zeros((24, size)), np.zeros((24, size))
    for t in np.arange(0.0, 2.0 * p["hold"], h) + 0.5 * h:
        missing = (by_load * heights(np.array([t])) - by_curvature * heights(np.array([t]), True)) @ (drawn - found)
        slope = 0.5 * p["height"] * rate / SPEED * np.sin(places + rate * t)
        force = f * missing[0] + (f * (by_load - by_curvature) * slope + p["stiffness"][:2].mean()) * e
        v -= h * (force + p["damping"][:2].mean() * v)
        e += h * v
    squares, percent = np.mean(np.square(e), axis=1), 100.0 / (AMPLITUDE * math.sqrt(2.0))
    found = percent * math.sqrt(squares.mean()), percent * math.sqrt(squares.max())
    assert found == pytest.approx(of_surface(1e-3, 1, strength)[1:], rel=0.15)


def test_what_an_edge_leaves_is_the_way_of_the_scanner_until_a_drive_can_answer_it():
    force, far = 0.1 * constants(2e-4)["f_0"], 8.0 * math.sqrt(2.0)
    stiffness, damping = np.mean([AXES[0], AXES[1]], axis=0)

    def rate(t, q):
        weak = 0.1 * math.sqrt(2.0) * t + q[0] < far
        return [q[1], force * weak - stiffness * q[0] - damping * q[1]]

    for period in (5e-5, 2e-4, 1e-3):
        hold = 1e4 * period
        way = solve_ivp(rate, (0.0, 2.0 * hold), [0.0, 0.0], max_step=0.05, dense_output=True).sol
        least, most = (way(np.linspace(0.0, end, 2001))[0].max() for end in (hold, 2.0 * hold))
        found = of_edges(period, 1)
        # Of 20 x0, along the diagonal.
        assert found[:2] == pytest.approx([5.0 * each / math.sqrt(2.0) for each in (least, most)], rel=0.01)
        assert 0.999 * found[0] <= found[2] <= 1.001 * found[1]


def test_no_sensor_sees_a_drift_over_a_flat_sample_and_the_tip_is_off_by_it():
    law = build(ControllerParameters, {"law.kind": "predictive", "law.period": 5e-5})
    sim = {"plant.control_period": 5e-5, "sample.beta": 0.0, "run.duration": 3.0 * 2.0 * math.pi / 50.0}
    still, moved = (
        simulate(build(SimParameters, sim | {f"drift.rate_{axis}": rate for axis in "xy"}), law) for rate in (0.0, 1e-9)
    )
    told = moved.measurements["position"] - still.measurements["position"]
    true = moved.truth["position"] - still.truth["position"]
    assert np.abs(told[:, :2]).max() < 1e-12
    # Of 5 nm; the table of wrong models scores the third period.
    assert true[-1, :2] / 5e-11 == pytest.approx([of_drift(1e-9)] * 2, rel=1e-3)


def test_tables_of_the_page_are_those_of_the_tool():
    for mark, text in tables().items():
        page = page_of(mark).read_text()
        assert between_marks(page, mark, text) == page


def test_tables_of_noise_are_those_of_the_tool():
    for mark, text in tables_of_noise(RATES[-1:]).items():
        assert set(text.splitlines()) <= set(page_of(mark).read_text().splitlines())


@pytest.mark.long
def test_all_rows_of_the_tables_of_noise_are_those_of_the_tool():
    for mark, text in tables_of_noise().items():
        page = page_of(mark).read_text()
        assert between_marks(page, mark, text) == page


@pytest.mark.long
def test_the_table_of_the_loop_is_that_of_the_tool():
    page = page_of("bound loop").read_text()
    assert between_marks(page, "bound loop", of_loop()) == page


@pytest.mark.parametrize("disturbance", [1e-4, 1e-2, 1.0])
def test_gains_of_the_observer_are_where_the_riccati_recursion_ends(disturbance):
    stiffness, damping = AXES[0]
    L = observer_gains(stiffness, damping, 0.5, disturbance, 0.2)
    Phi, Gamma = transition(stiffness, damping, 0.5)
    P = np.eye(2)
    for _ in range(20_000):
        gain = P[:, 0] / (P[0, 0] + 0.04)
        P = Phi @ (P - np.outer(gain, P[0])) @ Phi.T + np.outer(Gamma, Gamma) * disturbance**2
    assert pytest.approx(P[:, 0] / (P[0, 0] + 0.04), rel=1e-6) == L
