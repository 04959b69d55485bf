"""Claims about the contact from DMT to JKR: the exact equations, and the table of them that kernels read.

The reference solves the implicit equations of Maugis in contact radius and outer radius, as printed, by a root finder.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from afm_model.compiled.jit import plain
from afm_model.contact import jkr
from afm_model.contact.contact_table import NODES, REACH, ROW, attraction, end_of_contact, look_up, table, transitions
from afm_model.contact.maugis import along, branch, pull_off

LAMBDAS = (0.05, 0.2, 0.6, 1.0, 1.62, 3.0, 10.0)


def implicit(lam: float, force: float, low: float, high: float) -> tuple[float, float]:
    """(a, d) under a force, a between two bounds, by the equations of Maugis (1992) in a and m = c/a."""

    def zone(a: float) -> float:
        """mu = sqrt(m^2 - 1)."""

        def one(mu: float) -> float:
            m, arc = math.sqrt(1.0 + mu * mu), math.atan(mu)
            first = lam * a * a / 2.0 * (mu + (m * m - 2.0) * arc)
            return first + 4.0 * lam * lam * a / 3.0 * (mu * arc - m + 1.0) - 1.0

        return float(brentq(one, 1e-6, 1e6, xtol=1e-15, rtol=1e-14))

    def excess(a: float) -> float:
        mu = zone(a)
        return a**3 - lam * a * a * (mu + (1.0 + mu * mu) * math.atan(mu)) - force

    a = float(brentq(excess, low, high, xtol=1e-14, rtol=1e-14))
    return a, a * a - 4.0 / 3.0 * lam * a * zone(a)


@pytest.mark.parametrize("lam", LAMBDAS)
@pytest.mark.parametrize("force", [-1.0, 0.0, 3.0, 100.0])
def test_branch_solves_the_implicit_equations_of_maugis(lam, force):
    exact = branch("maugis", lam)
    fine = np.linspace(0.0, REACH, 4000)
    _, forces = exact.solve(exact.least_indentation + fine**2)
    # The place at which the branch bears the force, beyond pull-off.
    after = int(np.argmin(forces))
    s = np.interp(force, forces[after:], fine[after:])
    d = exact.least_indentation + s * s
    a = float(exact.solve(np.array([d]))[0][0])
    reference_a, reference_d = implicit(lam, force, 0.95 * a, 1.05 * a)
    # Linear interpolation on 4000 points bends by 1e-5; both are computed to round-off.
    assert d == pytest.approx(reference_d, abs=1e-4)
    again, borne = exact.solve(np.array([reference_d]))
    assert again[0] == pytest.approx(reference_a, rel=1e-9)
    assert borne[0] == pytest.approx(force, abs=1e-8)


def test_a_narrow_adhesive_zone_is_that_of_the_equations_before_their_terms_cancel():
    lam, t = 1.3, np.array([0.0199])  # so wide that they cancel to 1e-12 only
    mu, m = math.tan(t[0]), 1.0 / math.cos(t[0])
    first, second = mu + (m * m - 2.0) * t[0], mu * t[0] - m + 1.0
    a, force, d = (float(each[0]) for each in along(lam)(t))
    assert lam * a * a / 2.0 * first + 4.0 * lam * lam * a / 3.0 * second == pytest.approx(1.0, rel=1e-9)
    assert force == pytest.approx(a**3 - lam * a * a * (mu + m * m * t[0]), rel=1e-12)
    assert d == pytest.approx(a * a - 4.0 / 3.0 * lam * a * mu, rel=1e-12)


def test_pull_off_goes_from_2_of_dmt_to_3_2_of_jkr():
    forces = [pull_off("maugis", lam) for lam in (0.01, *LAMBDAS, 100.0)]
    assert forces == sorted(forces, reverse=True)
    assert forces[0] == pytest.approx(2.0, abs=3e-3)
    assert forces[-1] == pytest.approx(1.5, abs=1e-4)
    assert pull_off("dmt") == 2.0
    assert pull_off("jkr") == pytest.approx(1.5, abs=1e-12)


@pytest.mark.parametrize(
    ("lam", "indentation", "force"), [(1.0, -0.992, -0.892), (1.62, -0.952, -0.843), (3.0, -0.923, -0.837)]
)
def test_contact_breaks_at_fixed_grips_where_the_indentation_is_least(lam, indentation, force):
    # Three digits are given.
    exact = branch("maugis", lam)
    assert exact.least_indentation == pytest.approx(indentation, abs=5e-4)
    assert exact.at(np.array([exact.end]))[1][0] == pytest.approx(force, abs=5e-4)


def test_jkr_branch_is_that_of_the_paper_plants():
    # d = delta R_e / a0^2 of contact/jkr.py has the unit 6^(2/3) of this module, its load the unit 3/2.
    d = np.linspace(-0.27, 20.0, 50)
    u = np.array([plain(jkr.u_of_indentation)(each) for each in d])
    a, force = branch("jkr").solve(6.0 ** (2.0 / 3.0) * d)
    assert a == pytest.approx(6.0 ** (1.0 / 3.0) * u**2, rel=1e-10)
    assert force == pytest.approx(1.5 * np.array([plain(jkr.load_of_u)(each) for each in u]), abs=1e-9)


@pytest.mark.parametrize("case", [("maugis", lam) for lam in LAMBDAS] + [("jkr", 0.0), ("dmt", 0.0)], ids=str)
def test_table_is_exact_to_1e_4_over_the_whole_branch(case):
    model, lam = case
    exact = branch(model, lam)
    values = table(model, np.array([lam])).ravel()
    # Between the nodes, in the middle, where interpolation is worst, and beside it; and beyond the table.
    nodes, beyond = np.arange(NODES - 1), [1.1 * REACH, 2.0 * REACH]
    s = np.concatenate([(nodes + 0.5) * REACH / (NODES - 1), (nodes[::8] + 0.2) * REACH / (NODES - 1), beyond])
    d = exact.least_indentation + s * s
    a, force = exact.solve(d)
    found = np.array([look_up(each, 0.0, values, 0, 1) for each in d])
    assert np.abs((found[:, 0] - force) / np.maximum(1.0, np.abs(force))).max() < 1e-4
    assert np.abs((found[:, 2] - a) / np.maximum(1.0, a)).max() < 1e-4
    # The slopes are those of the values.
    step = 1e-5 * s * s
    above, below = (np.array([look_up(x, 0.0, values, 0, 1) for x in d + way * step]) for way in (1.0, -1.0))
    slopes = (above - below) / (2.0 * step)[:, None]
    assert slopes[:, 0] == pytest.approx(found[:, 1], rel=1e-5, abs=1e-5)
    assert slopes[:, 2] == pytest.approx(found[:, 3], rel=1e-5, abs=1e-5)


@pytest.mark.parametrize(("lam", "of_force", "of_radius"), [(0.6, 1e-6, 1e-6), (0.94, 5e-4, 5e-3), (1.62, 1e-6, 1e-8)])
def test_table_between_the_end_of_the_branch_and_its_third_node_is_as_exact_as_the_page_says(lam, of_force, of_radius):
    exact = branch("maugis", lam)
    values = table("maugis", np.array([lam])).ravel()
    s = np.geomspace(1e-4, 0.05, 300)
    d = exact.least_indentation + s * s
    a, force = exact.solve(d)
    found = np.array([look_up(each, 0.0, values, 0, 1) for each in d])
    assert np.abs(found[:, 0] - force).max() < of_force
    assert 0.01 * of_radius < np.abs(found[:, 2] - a).max() < of_radius
    # Relative to the radius it is more, where this is small.
    assert a[s < 0.0078].max() < 0.1 or lam != 0.94
    assert np.abs(found[s > 0.0078, 2] / a[s > 0.0078] - 1.0).max() < 0.07


def test_table_between_two_transition_parameters_is_exact_to_1e_4():
    rows = transitions(0.8, 1.3)
    values = table("maugis", rows).ravel()
    assert values.size == len(rows) * ROW
    worst = 0.0
    for lam in np.linspace(0.8, 1.3, 7):
        exact = branch("maugis", lam)
        row = (lam - rows[0]) / (rows[1] - rows[0])
        assert end_of_contact(row, values, 0, len(rows)) == pytest.approx(exact.least_indentation, abs=1e-4)
        d = exact.least_indentation + np.linspace(0.05, 6.0, 40) ** 2
        a, force = exact.solve(d)
        found, above, below = (
            np.array([look_up(each + step, row, values, 0, len(rows)) for each in d]) for step in (0.0, 1e-7, -1e-7)
        )
        worst = max(worst, float(np.abs((found[:, 0] - force) / np.maximum(1.0, np.abs(force))).max()))
        assert found[:, 2] == pytest.approx(a, rel=1e-4)
        assert found[:, 1::2] == pytest.approx((above - below)[:, ::2] / 2e-7, rel=1e-5, abs=1e-5)
    assert worst < 1e-4


def test_attraction_has_its_own_slope():
    force, slope = attraction(1e-9, 1e-27)
    assert force == pytest.approx(-1e-27 / 6e-18)
    # Approach by 1e-15 m: the second difference is 1e-6 of the slope.
    assert (attraction(1e-9 - 1e-15, 1e-27)[0] - force) / 1e-15 == pytest.approx(slope, rel=1e-5)
