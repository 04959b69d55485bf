"""Claims about the initial state."""

import math

import numpy as np
import pytest

from afm_model import Instrument, InstrumentParameters, ParameterError, build
from afm_model.plant import rest, state

from ..rolling import compliant, constants, named


@pytest.mark.parametrize("z_r", [-0.5, 0.0, 1e-6, 0.01, 1.0])
def test_initial_state_is_an_equilibrium(z_r):
    c = constants(0.01)
    s, u_z = rest(c, z_r)
    states = compliant(s, c, np.tile([0.0, 0.0, u_z], (5000, 1)))
    # Round-off of a stiffness of 550 in lengths of z_r; the lateral rest is exact.
    assert states[:, [state.Q, state.Z]] == pytest.approx(np.tile(s[[state.Q, state.Z]], (5001, 1)), abs=1e-13)
    assert states[:, state.N] == pytest.approx(s[state.N], abs=1e-11)
    assert not states[:, [state.X, state.V_X, state.Y, state.V_Y]].any()


def test_initial_load_is_that_of_the_bent_cantilever_and_bound_of_friction_that_of_the_paper():
    c = constants(0.01)
    p = named(c)
    s, _ = rest(c, 0.01)
    load = p.eta_c**2 * 0.01 + p.w
    assert s[state.N] == pytest.approx(load, rel=1e-14)
    assert s[state.F_MAX] == pytest.approx(p.f_s * (1.0 + math.sqrt(1.0 + load / p.L_s)) ** (4.0 / 3.0), rel=1e-14)


def test_setpoint_that_adhesion_cannot_hold_is_refused_with_its_numbers():
    beyond = (2.538 + 0.01) / 1.508**2 * 1e-7  # height at which the static load is the pull-off load
    Instrument(build(InstrumentParameters, {"cantilever.a": 0.99 * beyond}))
    with pytest.raises(ParameterError, match=r"must be > -1\.523e-07 N.*reference\.z_r.*cantilever\.a = 1\.13"):
        Instrument(build(InstrumentParameters, {"cantilever.a": 1.01 * beyond}))


def test_default_instrument_starts_at_the_setpoint_in_contact_and_at_rest():
    scope = Instrument(InstrumentParameters())
    assert scope.in_contact
    assert scope.state[state.Q] == pytest.approx(1e-6, rel=1e-12)
    assert not scope.state[[state.X, state.V_X, state.Y, state.V_Y, state.V_Z, state.V_Q]].any()
