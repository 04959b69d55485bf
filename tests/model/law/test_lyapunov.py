"""Claims about the Lyapunov function of the error dynamics (section 3 of the paper) and the bound it gives for tanh."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import block_diag
from scipy.optimize import minimize_scalar

from afm_model import ControllerParameters, SimParameters, build, simulate
from afm_model.law import TANH_GAP, error_matrix, lyapunov_matrix, ultimate_bound
from afm_model.law.paper import SGN, TANH, switching

gains = st.floats(0.05, 50.0)
M, ALPHA = 15.0, 20.0  # section 4.2 of the paper; the steepness of its scenarios


def test_P_of_the_paper_gains():
    # Solved by hand from P A + A^T P = -I.
    assert lyapunov_matrix(1.0, 1.0) == pytest.approx(np.array([[1.5, 0.5], [0.5, 1.0]]), abs=1e-14)
    assert lyapunov_matrix(2.0, 3.0) == pytest.approx(np.array([[1.25, 0.25], [0.25, 0.25]]), abs=1e-14)


@given(gains, gains, st.floats(0.1, 10.0), st.floats(-0.3, 0.3), st.floats(0.1, 10.0))
def test_P_solves_the_lyapunov_equation_and_is_positive(c, cdot, q1, skew, q4):
    Q = np.array([[q1, skew * math.sqrt(q1 * q4)], [skew * math.sqrt(q1 * q4), q4]])
    A = error_matrix(c, cdot)
    P = lyapunov_matrix(c, cdot, Q)
    np.testing.assert_array_equal(P, P.T)
    assert np.linalg.eigvalsh(P)[0] > 0.0
    # Round-off of numbers as large as P times A.
    assert P @ A + A.T @ P == pytest.approx(-Q, abs=1e-12 * np.abs(P).max() * max(c, cdot, 1.0))


@pytest.mark.parametrize(("c", "cdot"), [(0.0, 1.0), (1.0, 0.0), (-1.0, 1.0), (1.0, -1.0), (math.nan, 1.0)])
def test_gains_that_do_not_stabilise_are_refused(c, cdot):
    with pytest.raises(ValueError, match="must both be > 0"):
        lyapunov_matrix(c, cdot)


@pytest.mark.parametrize(("c", "cdot"), [(1.0, 1e8), (1e-9, 1e3)])
def test_gains_of_very_different_size_are_solved_to_the_last_digits(c, cdot):
    P = lyapunov_matrix(c, cdot)
    p11, p12, p22 = (Fraction(float(each)) for each in (P[0, 0], P[0, 1], P[1, 1]))
    exact12 = Fraction(1) / (2 * Fraction(c))
    exact22 = (Fraction(1, 2) + exact12) / Fraction(cdot)
    for found, exact in ((p12, exact12), (p22, exact22), (p11, Fraction(cdot) * exact12 + Fraction(c) * exact22)):
        assert abs(found / exact - 1) < 1e-15


def test_gains_that_leave_no_digits_are_refused():
    with pytest.raises(ValueError, match="too far from 1"):
        lyapunov_matrix(1e-20, 1.0)


@pytest.mark.parametrize(
    "Q", [np.diag([1.0, -1.0]), -np.eye(2), np.ones((2, 2)), np.array([[1.0, 0.5], [0.0, 1.0]]), np.eye(3)]
)
def test_weight_that_is_not_symmetric_positive_definite_is_refused(Q):
    with pytest.raises(ValueError, match="must be symmetric and positive definite"):
        lyapunov_matrix(1.0, 1.0, Q)


@pytest.mark.parametrize(("alpha", "M", "weight"), [(0.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, 0.0)])
def test_bound_of_what_is_no_law_is_refused(alpha, M, weight):
    with pytest.raises(ValueError, match="must be > 0"):
        ultimate_bound(np.eye(2), alpha, M, weight)


def test_bound_with_an_indefinite_P_is_refused():
    with pytest.raises(ValueError, match="must be positive definite"):
        ultimate_bound(np.diag([1.0, -1.0]), 1.0, 1.0)


def test_gap_between_tanh_and_sgn_is_0_2785_over_alpha():
    found = minimize_scalar(
        lambda s: -s * (1.0 - math.tanh(s)), bounds=(0.0, 3.0), method="bounded", options={"xatol": 1e-9}
    )
    # A maximum is flat: 1e-9 in s is 1e-18 in its value.
    assert pytest.approx(-found.fun, abs=1e-14) == TANH_GAP


@given(st.floats(-10.0, 10.0), st.floats(0.1, 200.0))
def test_tanh_costs_at_most_its_gap(s, alpha):
    assert abs(s) - s * switching(TANH, s, alpha) <= TANH_GAP / alpha * (1.0 + 1e-12)


def rate_of_V(e: np.ndarray, kind: int, disturbance: float) -> float:
    """dV/dt of V = e'Pe along e' = A e + B (v - f)."""
    P = lyapunov_matrix(1.0, 1.0)
    s = P[1] @ e
    psi = -M * switching(kind, s, ALPHA) - disturbance
    return float(2.0 * e @ P @ (error_matrix(1.0, 1.0) @ e + np.array([0.0, psi])))


directions = st.floats(0.0, 2.0 * math.pi)
# The worst disturbance that M bounds pushes along -s; any other does less.
disturbances = st.floats(-M, M) | st.sampled_from([-M, M])


@given(directions, st.floats(1e-6, 1e3), disturbances)
def test_sgn_makes_V_fall_at_every_error(angle, size, f):
    e = size * np.array([math.cos(angle), math.sin(angle)])
    # dV/dt <= -e'e: half of it as a margin for round-off of terms of the size 30 |e|.
    assert rate_of_V(e, SGN, f) <= -0.5 * size**2 + 1e-13 * size


@given(directions, st.floats(1.0001, 1e3), disturbances)
def test_tanh_makes_V_fall_outside_its_ball(angle, times, f):
    ball = math.sqrt(2.0 * TANH_GAP * M / ALPHA)
    e = times * ball * np.array([math.cos(angle), math.sin(angle)])
    assert rate_of_V(e, TANH, f) < 0.0


def test_the_ball_of_tanh_is_needed():
    # Well inside, the worst disturbance can make V grow: the paper's sgn argument does not carry over.
    e = np.array([0.02, 0.01])
    assert rate_of_V(e, TANH, -M) > 0.0


def test_the_ball_shrinks_with_the_steepness():
    P = lyapunov_matrix(1.0, 1.0)
    assert ultimate_bound(P, 80.0, M) == pytest.approx(0.5 * ultimate_bound(P, 20.0, M), rel=1e-14)
    eigenvalues = np.linalg.eigvalsh(P)
    by_hand = math.sqrt(2.0 * TANH_GAP * M / ALPHA) * math.sqrt(eigenvalues[1] / eigenvalues[0])
    assert ultimate_bound(P, ALPHA, M) == pytest.approx(by_hand, rel=1e-14)


def settled_error(disturbance, rng: np.random.Generator, start: np.ndarray) -> float:
    """Largest ||e|| after the transient under a disturbance f(s, t), by the midpoint rule."""
    P, A = lyapunov_matrix(1.0, 1.0), error_matrix(1.0, 1.0)
    h, e, largest = 0.005, start.copy(), 0.0
    for i in range(12_000):
        f = disturbance(P[1] @ e, i * h)

        def slope(x: np.ndarray, f: float = f) -> np.ndarray:
            return A @ x + np.array([0.0, -M * math.tanh(ALPHA * (P[1] @ x)) - f])

        e = e + h * slope(e + 0.5 * h * slope(e))
        if i > 8000:
            largest = max(largest, float(np.hypot(*e)))
    return largest


def test_ultimate_bound_holds_under_the_worst_disturbances(rng):
    bound = ultimate_bound(lyapunov_matrix(1.0, 1.0), ALPHA, M)
    start = np.array([20.0, -10.0])
    flips = rng.uniform(-M, M, 200)
    worst = [
        settled_error(lambda s, t: -M if s > 0.0 else M, rng, start),
        settled_error(lambda s, t: M * (1.0 if math.sin(t) > 0.0 else -1.0), rng, start),
        settled_error(lambda s, t: flips[int(t / 0.3) % 200], rng, start),
    ]
    assert max(worst) < bound
    # The bound is not idle: a constant force of M is held with tanh = 1 at an error that tanh alone cannot remove.
    assert max(worst) > 0.05 * bound


W0, X0, Z0 = 1e4, 2.5e-10, 1e-7
TRIANGLES = {"reference.shape_x": "triangle", "reference.shape_y": "triangle"}
FAST = {"reference.amplitude_x": 2.5e-8, "reference.amplitude_y": 2.5e-8, "reference.omega_x": 1e3}


def errors_of_a_run(law: dict[str, object], period: float) -> tuple[np.ndarray, np.ndarray]:
    """e = (e_x, e_x', e_y, e_y', e_z, e_z') at every tick of a triangular scan, (n, 6); where a corner is next."""
    values = TRIANGLES | FAST | {"reference.omega_y": 5e2, "run.duration": 6e-3, "score.start": 0.0}
    values |= {"plant.kind": "paper", "plant.z": "uniform", "plant.M_z": 0.05, "plant.dt": period}
    values |= {"plant.control_period": period, "detector.sample_period": period}
    run = simulate(build(SimParameters, values), build(ControllerParameters, law | {"law.z_rate": "tip"}))
    e = np.empty((len(run.time), 6))
    rate = run.measurements.reference_velocity[:, :2]
    e[:, 0:4:2] = (run.position - run.reference)[:, :2] / X0
    e[:, 1:4:2] = (run.velocity[:, :2] - rate) / (X0 * W0)
    e[:, 4] = (run.deflection - run.reference[:, 2]) / Z0
    e[:, 5] = run.measurements.deflection_rate / (Z0 * W0)
    return e, np.abs(np.diff(rate, axis=0)).any(axis=1)


P6 = block_diag(lyapunov_matrix(1.0, 1.0), lyapunov_matrix(1.0, 1.0), lyapunov_matrix(2.0, 3.0))
BOUNDS = np.array([M, M, 0.05])


@pytest.mark.parametrize("alpha", [10.0, 20.0, 100.0])
def test_V_falls_at_every_tick_of_a_run_outside_the_ball_and_ends_below_its_bound(alpha):
    e, corner = errors_of_a_run({"law.kind": "tanh", "law.alpha": alpha, "law.alpha_z": alpha}, 1e-7)
    V, norm = np.einsum("ni,ij,nj->n", e, P6, e), np.linalg.norm(e, axis=1)
    ball = math.sqrt(2.0 * TANH_GAP * BOUNDS.sum() / alpha)
    outside = (norm[:-1] > ball) & ~corner
    assert np.count_nonzero(outside) > 1000
    assert (np.diff(V)[outside] < 0.0).all()
    # Between corners, once inside the ball: V stays below the level set that holds it, e within the ultimate bound.
    level = ball**2 * np.linalg.eigvalsh(P6)[-1]
    starts = np.concatenate([[0], np.flatnonzero(corner) + 1, [len(V)]])
    entered = 0
    for start, stop in itertools.pairwise(starts):
        inside = np.flatnonzero(norm[start:stop] <= ball)
        if len(inside):
            entered += 1
            assert V[start + inside[0] : stop].max() <= level
            assert norm[start + inside[0] : stop].max() <= ultimate_bound(P6, alpha, BOUNDS.sum())
    assert entered >= 3


def test_under_sgn_V_falls_along_a_run_but_for_the_chatter_within_a_few_control_periods():
    period = 1e-7
    e, corner = errors_of_a_run({"law.kind": "sgn"}, period)
    V, norm = np.einsum("ni,ij,nj->n", e, P6, e), np.linalg.norm(e, axis=1)
    # A sampled sgn overshoots s = 0 by a period: V falls over every 5 us, not over every 0.1 us.
    n = 50
    away = np.convolve(corner, np.ones(n), "valid") == 0.0
    outside = (norm[:-n] > 0.5) & away
    assert np.count_nonzero(outside) > 1000
    assert (V[n:] < V[:-n])[outside].all()
