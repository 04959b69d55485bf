"""Claims about the linearised loop: it is the loop that the instrument runs, and its margins are true."""

import sys
from typing import Any

import numpy as np
import pytest

from afm_model import Controller, ControllerParameters, Instrument, SimParameters, build
from afm_model.parts import Law, LawParameters, Record, kernel
from afm_model.plant.constants import plant_constants
from afm_model.studies.linear import at_timing, is_stable, largest, linearise
from afm_model.studies.linear_model import (
    LinearError,
    jacobian,
    law_scales,
    measurement_at_rest,
    measurement_sliding,
    nominal_friction,
    plant_matrices,
    sensors,
)


def timed(kind: str, period: float, delay: int = 0, sim: dict[str, object] | None = None, **law: object):
    controller = build(ControllerParameters, {"law.kind": kind} | {f"law.{name}": value for name, value in law.items()})
    return at_timing(build(SimParameters, sim or {}), controller, period, delay)


def test_linear_plant_moves_as_the_instrument_does_out_of_friction():
    # No shear strength to speak of, a flat sample: nothing but the springs is left.
    given = {"contact.tau": 1e-3, "sample.beta": 0.0, "plant.control_period": 2e-5}
    sim = build(SimParameters, given)
    instrument = Instrument(sim, 1, hashed=False)
    start = instrument.truth.copy()
    drive, step = instrument.drive.copy(), np.array([0.01, -0.02, 1e-3])
    A, B, _ = plant_matrices(sim, 2e-5)
    x = np.zeros(8)
    for _ in range(50):
        instrument.tick(drive + step)
        instrument.skip_block()
        x = A @ x + B @ step
    moved = instrument.truth["position"].ravel() - start["position"].ravel()
    np.testing.assert_allclose(moved, x[[0, 2, 4]] * [2.5e-10, 2.5e-10, 1e-7], rtol=2e-3)
    tip = float(instrument.truth["tip_height"].item() - start["tip_height"].item())
    assert tip == pytest.approx(x[6] * 1e-7, rel=2e-3)


@pytest.mark.parametrize("amplitudes", [(5e-9, 0.0), (5e-9, 5e-9), (5e-9, -2e-9)], ids=["x", "diagonal", "oblique"])
@pytest.mark.parametrize("push", [(1.0, 0.0), (0.0, 1.0), (0.7, -0.7)], ids=["along x", "along y", "oblique"])
def test_linear_plant_moves_as_the_instrument_does_around_steady_sliding(amplitudes, push):
    # Friction turns with the motion: across it a push dies out, along it friction stays what it is.
    given = {f"reference.amplitude_{axis}": size for axis, size in zip("xy", amplitudes, strict=True)}
    sim = build(SimParameters, given | {"sample.beta": 0.0, "reference.omega_x": 1e4, "reference.omega_y": 1e4})
    A, _, _ = plant_matrices(sim, sim.plant.control_period)
    x = np.zeros(8)
    x[[1, 3]] = 1e-3 * np.array(push)
    found = slid(sim, 1e-3 * np.array(push)) - slid(sim, -1e-3 * np.array(push))
    for moved in 0.5 * found:
        x = A @ x
        np.testing.assert_allclose(moved, x[:4], rtol=0, atol=3e-3 * np.max(np.abs(x[[0, 2]])))


def slid(sim: SimParameters, push: Any) -> Any:
    """X, V_X, Y, V_Y of an instrument that slides steadily, its velocity changed by a push at the start (ticks, 4)."""
    instrument = Instrument(sim, 1, hashed=False)
    state, p = instrument.record("plant_state"), plant_constants(sim)
    friction = nominal_friction(sim)[:2]
    velocity = np.array(sim.reference.velocity) / (sim.scales.x0 * sim.scales.w0)
    hold, place = sim.scales.w0 * sim.plant.control_period, np.array([state["X"], state["Y"]])
    state["V_X"], state["V_Y"] = velocity + push
    drive, states = instrument.drive.copy(), []
    for k in range(100):
        for i, axis in enumerate("xy"):
            eta, xi = p[f"eta_{axis}"], p[f"xi_{axis}"]
            middle = place[i] + (k + 0.5) * hold * velocity[i]
            drive[i] = (eta * eta * middle + 2.0 * xi * eta * velocity[i] + friction[i]) / p[f"gain_{axis}"]
        instrument.tick(drive)
        instrument.skip_block()
        states.append([float(state[name]) for name in ("X", "V_X", "Y", "V_Y")])
    return np.array(states)


def test_paper_law_is_stable_up_to_the_hold_at_which_its_steepness_says_so():
    # Against friction the slope of tanh is alpha M (1 - (f / M)^2), and a hold bears a slope up to 2 / hold.
    friction = 12.75 / np.sqrt(2.0)
    for alpha in (2.0, 10.0):
        slope = alpha * 15.0 * (1.0 - (friction / 15.0) ** 2)
        longest = 2.0 / slope / 1e4
        assert linearise(*timed("tanh", 1e-6 * np.floor(0.85e6 * longest), alpha=alpha)).stable
        assert not linearise(*timed("tanh", 1e-6 * np.ceil(1.15e6 * longest), alpha=alpha)).stable


@pytest.mark.parametrize("kind", ["pid", "super_twisting"])
def test_delay_margin_is_the_delay_that_the_loop_bears(kind):
    # The law is left as it is: it does not know of the delay. Along x, friction couples no axes.
    along_x = {"reference.amplitude_y": 0.0}
    sim, controller = timed(kind, 2e-5, sim=along_x)
    margin = min(linearise(sim, controller).margins(axis).delay for axis in "xy")
    for delay in (1, 2, 3):
        delayed = build(SimParameters, {"plant.control_period": 2e-5, "plant.delay_ticks": delay} | along_x)
        loop = linearise(delayed, controller)
        assert loop.stable == (delay * 2e-5 < margin) or loop.axis == "z"


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_loop_that_bears_its_delay_settles_against_friction_with_it(delay):
    # It would not with a tick more than two.
    sim, controller = timed("implicit", 1e-5, delay)
    assert linearise(sim, controller).stable
    sliding = measurement_sliding(sim, Controller(controller), sensors(sim))
    assert np.max(np.abs(sliding - measurement_at_rest(sim))) > 0.01  # the drive [V]


def test_margins_are_those_of_python_control_for_its_own_system():
    import control

    loop = linearise(*timed("pid", 5e-5, sim={"reference.amplitude_y": 0.0}))
    omega = np.geomspace(10.0, 5e4, 50)
    own = control.frequency_response(loop.control_system("x"), omega)
    np.testing.assert_allclose(own.magnitude.squeeze(), np.abs(loop.response("x", omega)), rtol=1e-6)
    margins = loop.margins("x")
    assert 30.0 < margins.phase < 40.0 and margins.gain > 2.0  # the tight tuning of SIMC
    assert margins.distance == pytest.approx(
        np.min(np.abs(1.0 + loop.response("x", np.geomspace(100.0, 6e4, 4000)))), rel=0.01
    )


@pytest.mark.parametrize(
    ("kind", "period", "delay"),
    [("pid", 5e-5, 0), ("observer", 2e-5, 2), ("super_twisting", 5e-5, 1), ("tanh", 2e-6, 3)],
)
def test_smallest_distance_is_that_of_the_response_at_all_frequencies(kind, period, delay):
    loop = linearise(*timed(kind, period, delay))
    omega = np.pi / period * np.geomspace(1e-4, 0.999, 400)
    assert loop.distance(omega) == min(np.min(np.abs(1.0 + loop.response(axis, omega))) for axis in loop.cuts)


def test_slopes_of_a_law_are_those_of_its_answers():
    sim, controller = timed("pid", 5e-5)
    law, C = Controller(controller), sensors(sim)
    y = measurement_sliding(sim, law, C)
    states, inputs = law_scales(law, y, C)
    _, from_input = jacobian(law, y, states, inputs)
    settled = law.block.copy()
    for i in np.flatnonzero(inputs):
        change, answers = np.zeros(len(y)), []
        change[i] = 3.0 * inputs[i]
        for shown in (y + change, y - change):
            law.block[:] = settled
            answers.append(np.array(law.answer(shown)))
        np.testing.assert_allclose(6.0 * inputs[i] * from_input[-3:, i], answers[0] - answers[1], rtol=1e-4, atol=1e-10)


def test_law_that_switches_has_no_linear_model():
    with pytest.raises(LinearError, match=r"^law sgn switches"):
        linearise(*timed("sgn", 2e-6))


class CountingParameters(LawParameters):
    """None of its own."""


class State(Record):
    number: int


@kernel
def count(t: float, y: Any, u: Any, p: Any, s: Any) -> None:
    """The drive as it is; every measurement counts."""
    s.number += 1
    for axis in range(3):
        u.voltage[axis] = y.drive[axis]


COUNTING = Law(name="counting", parameters=CountingParameters, state=State, control=count)


def test_law_that_counts_has_no_linear_model(monkeypatch):
    monkeypatch.setitem(sys.modules, "counting_law", sys.modules[__name__])
    with pytest.raises(LinearError, match=r"counts its ticks"):
        linearise(*timed("counting_law:COUNTING", 2e-6))


def test_law_is_left_as_it_was():
    sim, controller = timed("observer", 5e-5)
    law = Controller(controller)
    before = law.block.copy()
    linearise(sim, controller)
    np.testing.assert_array_equal(law.block, before)


def test_period_that_the_instrument_cannot_have_counts_as_unstable():
    sim, controller = timed("pid", 5e-5)
    assert is_stable(sim, controller, 5e-5, 0)
    assert not is_stable(sim, controller, 1.5e-6, 0)


@pytest.mark.parametrize("limit", [-1, 0, 3, 7])
def test_limit_is_found_where_it_is(limit):
    assert largest(lambda n: n <= limit, 7) == limit


@pytest.mark.parametrize(("law", "delay"), [("predictive", 0), ("pid", 10_000)], ids=["of the law", "of the delay"])
def test_a_loop_with_more_numbers_than_can_be_handled_has_no_linear_model(law, delay):
    values = {"plant.control_period": 5e-5, "plant.delay_ticks": delay}
    sim = build(SimParameters, values)
    controller = build(ControllerParameters, {"law.kind": law, "law.period": 5e-5, "law.delay_ticks": min(delay, 5)})
    with pytest.raises(LinearError, match=r"500 numbers are the most"):
        linearise(sim, controller)
