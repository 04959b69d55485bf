"""Claims about what a tip that rests is given by the friction-predicting law."""

import math

import numpy as np
import pytest

from afm_predictive.asked import ask
from afm_predictive.decide import decide
from afm_predictive.nominal_plant import bound_at

from .law_records import records


def decided(rng, **law):
    """Constants, and a state with the drive of least squares, somewhere on a sine of 20 x0 with its scanner near it."""
    p, s = records(**{"period": 1e-3, "surface": "known", "friction": "nominal"} | law)
    w, phase = 0.005, rng.uniform(0.0, 2.0 * math.pi)
    for axis in range(2):
        s.p[axis], s.v[axis] = 20.0 * math.sin(phase), 20.0 * w * math.cos(phase)
        s.acc[axis], s.omega[axis] = -w * w * s.p[axis], w
    s.fastest = 0.1 * math.sqrt(2.0)
    ask(0.0, p.horizon + p.fine, p, s)
    s.X, s.Y = s.p[:2] + rng.uniform(-0.5, 0.5, 2)
    s.Z = s.path[0, 2, 0] + rng.uniform(-0.02, 0.02)
    decide(0, 0, p, s)
    return p, s


def given_at_rest(behind, p, s):
    """Direction of the reference, and by what the drive for a tip so far behind it is more because it rests."""
    forward, plans = np.array(s.v[:2]) / np.hypot(*s.v[:2]), []
    s.X, s.Y = np.array(s.p[:2]) - behind * forward
    for speed in (0.0, 1e-15):
        s.V_X = s.V_Y = speed
        decide(0, 0, p, s)
        plans.append(np.array(s.plan[0]))
    return forward, plans[0] - plans[1]


@pytest.mark.parametrize(("behind", "freed"), [(2.0, True), (-2.0, False), (0.1, False)])
def test_a_tip_that_rests_behind_the_reference_is_given_the_friction_of_its_own_place(behind, freed):
    p, s = decided(np.random.default_rng(3), period=2e-4)
    forward, more = given_at_rest(behind, p, s)
    # There it is stronger than along the reference.
    stronger = float(bound_at(s.X, s.Y, s.Z, p, s) - s.friction[0])
    assert stronger > 0.005 * s.friction[0] or not freed
    assert more == pytest.approx([*(stronger * forward), 0.0] if freed else np.zeros(3), rel=1e-3, abs=1e-9)


def test_it_is_given_no_more_than_a_surface_makes_of_a_difference():
    # In a packet friction is as it was asked for along the reference: here, wrongly, 10 % less.
    p, s = decided(np.random.default_rng(3), period=4e-4, packet=2)
    s.friction[:] *= 0.9
    forward, more = given_at_rest(2.0, p, s)
    assert more == pytest.approx([*(2.0 * p.ripple * s.friction[0] * forward), 0.0], rel=1e-3, abs=1e-9)
