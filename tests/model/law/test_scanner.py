"""Claims about the free scanner of the sampled laws: exact steps, poles, the drives in flight."""

import sys
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from afm_model import Controller, ControllerParameters, Instrument, SimParameters, build
from afm_model.law import SampledLaw, scanner
from afm_model.law.scanner import follow_flight, free_axis, place_poles, predict, scanner_values, send
from afm_model.parts import Law, Vector, kernel

ETA, XI = 0.42, 0.0366


@pytest.mark.parametrize("hold", [0.02, 0.5, 2.0, 10.0])
def test_step_of_an_axis_is_the_solution_of_its_equation(hold):
    axis = free_axis(ETA, XI, hold)
    solution = solve_ivp(
        lambda t, x: [x[1], 1.7 - ETA**2 * x[0] - 2.0 * XI * ETA * x[1]],
        (0.0, hold),
        [0.3, -0.8],
        rtol=1e-11,
        atol=1e-12,
    )
    np.testing.assert_allclose(axis.phi @ [0.3, -0.8] + 1.7 * axis.gamma, solution.y[:, -1], rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize(("one", "other"), [(0.0, 0.4), (0.9, 0.9), (-0.2, 0.5)])
def test_feedback_places_the_poles_where_they_are_asked_for(one, other):
    axis = free_axis(ETA, XI, 0.5)
    closed = axis.phi - np.outer(axis.gamma, place_poles(axis, one, other))
    # The polynomial: a double pole itself is known to half of the digits only.
    np.testing.assert_allclose(np.poly(closed), np.poly([one, other]), atol=1e-12)


class ProbeParameters(SampledLaw):
    """No parameters but period and delay."""


class State(scanner.ScannerState):
    ahead: Vector
    rate_ahead: Vector


@kernel
def control(t: float, y: Any, u: Any, p: Any, s: Any) -> None:
    """Drive that has nothing to do with the motion; what is predicted is kept."""
    follow_flight(y, p, s)
    for axis in range(3):
        s.ahead[axis], s.rate_ahead[axis] = predict(y, p, s, axis, 0.0)
        # Along z about the drive that keeps the sample off the tip.
        start = -1.0 if axis == 2 else 0.0
        send(u, p, s, axis, start + 0.1 * np.sin(3e3 * t + axis) + (0.03 if t > 1e-3 else 0.0))
    s.follows = 1.0


PROBE = Law(
    name="probe",
    parameters=ProbeParameters,
    constants=scanner.ScannerConstants,
    state=State,
    values=scanner_values,
    control=control,
)


@pytest.mark.parametrize("delay", [0, 1, 5])
def test_prediction_is_where_the_free_scanner_will_be_when_the_drive_acts(delay, monkeypatch):
    monkeypatch.setitem(sys.modules, "probe_law", sys.modules[__name__])
    period = 5e-5
    given = {"plant.control_period": period, "plant.delay_ticks": delay, "plant.gap": 5e-7}
    instrument = Instrument(build(SimParameters, given), 1, hashed=False)
    law = {"law.kind": "probe_law:PROBE", "law.period": period, "law.delay_ticks": delay}
    controller = Controller(build(ControllerParameters, law))
    predicted, moved = [], []
    for _ in range(100):
        moved.append(instrument.truth["position"].copy().ravel() / [2.5e-10, 2.5e-10, 1e-7])
        drive = controller.answer(instrument.measurement, instrument.time).copy()
        predicted.append(controller.state["ahead"].copy())
        instrument.tick(drive)
        instrument.skip_block()
    wanted = np.array(moved)[delay:]
    assert np.ptp(wanted, axis=0).min() > 0.01  # it does move
    # The instrument's steps of 1 us are exact to some 1e-6 of the motion.
    np.testing.assert_allclose(np.array(predicted)[: len(wanted)], wanted, atol=3e-6 * np.abs(wanted).max())


def test_drive_of_a_sampled_law_stays_within_the_range_of_the_piezo(monkeypatch):
    monkeypatch.setitem(sys.modules, "probe_law", sys.modules[__name__])
    controller = Controller(build(ControllerParameters, {"law.kind": "probe_law:PROBE", "piezo.limit": 1e-3}))
    instrument = Instrument(build(SimParameters, {}), 1, hashed=False)
    drive = controller.answer(instrument.measurement, 5e-4)
    assert np.max(np.abs(drive)) == pytest.approx(1e-3)
