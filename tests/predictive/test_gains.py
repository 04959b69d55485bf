"""Claims about the gains of the friction-predicting law, against independent references."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from afm_model import ControllerParameters, build
from afm_predictive.constants import values
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


def radius(period, late):
    """Return the largest spectral radius of x, y and z with drives that come so many periods later than expected."""
    p, found = values(build(ControllerParameters, {"law.kind": "predictive", "law.period": period})), []
    for i in range(3):
        Phi, Gamma = transition(p["stiffness"][i], p["damping"][i], p["slot"])
        # Position, rate, and the drives on their way, the oldest last.
        A = np.zeros((2 + late, 2 + late))
        A[:2, :2] = Phi
        if late == 0:
            A -= np.outer(Gamma, p["K"][i])
        else:
            A[:2, -1], A[2, :2] = Gamma, -p["K"][i]
            A[range(3, 2 + late), range(2, 1 + late)] = 1.0
        found.append(float(max(abs(np.linalg.eigvals(A)))))
    return max(found)


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("late", [0, 1])
def test_the_loop_bears_a_drive_that_is_one_period_late(hold, late):
    assert radius(1e-4 * hold, late) < 1.0


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
