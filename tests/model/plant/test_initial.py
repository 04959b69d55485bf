"""Claims about the initial state."""

import math

import numpy as np
import pytest

from afm_model import Instrument, InstrumentParameters, ParameterError, build

from ..rolling import bench, compliant
from ..tables import columns


@pytest.mark.parametrize("z_r", [-0.5, 0.0, 1e-6, 0.01, 1.0])
def test_initial_state_is_an_equilibrium(z_r):
    c = bench(0.01)
    s, u_z = c.rest(z_r)
    states = compliant(s, c, np.tile([0.0, 0.0, u_z], (5000, 1)))
    # Round-off of a stiffness of 550 in lengths of z_r; the lateral rest is exact.
    assert columns(states, "Q", "Z") == pytest.approx(np.tile(columns(s, "Q", "Z"), (5001, 1)), abs=1e-13)
    assert states.N == pytest.approx(s.N, abs=1e-11)
    assert not columns(states, "X", "V_X", "Y", "V_Y").any()


def test_initial_load_is_that_of_the_bent_cantilever_and_bound_of_friction_that_of_the_paper():
    c = bench(0.01)
    p = c.p
    s, _ = c.rest(0.01)
    load = p.eta_c**2 * 0.01 + p.w
    assert s.N == pytest.approx(load, rel=1e-14)
    assert s.F_max == pytest.approx(p.f_s * (1.0 + math.sqrt(1.0 + load / p.L_s)) ** (4.0 / 3.0), rel=1e-14)


def test_setpoint_that_adhesion_cannot_hold_is_refused_with_its_numbers():
    beyond = (2.538 + 0.01) / 1.508**2 * 1e-7  # height at which the static load is the pull-off load
    Instrument(build(InstrumentParameters, {"cantilever.a": 0.99 * beyond}))
    with pytest.raises(ParameterError, match=r"must be > -1\.523e-07 N.*reference\.z_r.*cantilever\.a = 1\.13"):
        Instrument(build(InstrumentParameters, {"cantilever.a": 1.01 * beyond}))


def test_default_instrument_starts_at_the_setpoint_in_contact_and_at_rest():
    scope = Instrument(InstrumentParameters())
    assert scope.in_contact
    assert scope.state.Q == pytest.approx(1e-6, rel=1e-12)
    assert not columns(scope.state, "X", "V_X", "Y", "V_Y", "V_Z", "V_Q").any()
