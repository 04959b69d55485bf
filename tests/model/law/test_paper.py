"""Claims about the control laws: equation 6 of the paper, written out again in numpy."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_model import Controller, ControllerParameters, DivergenceError, SimParameters, build, simulate
from afm_model.compiled.records import size
from afm_model.core import registry
from afm_model.law.paper import SGN, TANH, switching
from afm_model.parts.signals import Measurement

from ..tables import array_of, record_of

W0, X0, Z0 = 1e4, 2.5e-10, 1e-7
LENGTH = np.array([X0, X0, Z0])


def equation_6(p: ControllerParameters, y: Any) -> np.ndarray:
    """Drive [V] by equation 6, all axes at once; z_c from the deflection, the rate of z as `law.z_rate` says."""
    law, scanner, cantilever = p.law, p.scanner, p.cantilever
    time = 1.0 / p.scales.w0
    length = np.array([p.scales.x0, p.scales.x0, p.scales.z0])
    eta = 2.0 * np.pi * np.array([scanner.f_x, scanner.f_y, scanner.f_z]) * time
    xi = np.array([scanner.xi_x, scanner.xi_y, scanner.xi_z])
    x = y.position / length
    x_rate = y.velocity / length * time
    x[2] = (cantilever.a + y.deflection) / p.scales.z0
    if law.z_rate == "tip":
        x_rate[2] = y.deflection_rate / p.scales.z0 * time
    reference = y.reference_position / length
    reference_rate = y.reference_velocity / length * time
    acceleration = y.reference_acceleration / length * time**2
    # The setpoint of z does not move: equation 6 has no rate of z_r.
    reference_rate[2] = acceleration[2] = 0.0
    e, e_rate = x - reference, x_rate - reference_rate
    c = np.array([law.c_x, law.c_y, law.c_z])
    cdot = np.array([law.cdot_x, law.cdot_y, law.cdot_z])
    # P A + A^T P = -I by hand: p2 = 1/(2c), p4 = (1 + 1/c)/(2 cdot).
    s = e / (2.0 * c) + (1.0 + 1.0 / c) / (2.0 * cdot) * e_rate
    alpha = np.array([law.alpha, law.alpha, law.alpha_z])
    v = -np.array([law.M_x, law.M_y, law.M_z]) * (np.sign(s) if law.kind == "sgn" else np.tanh(alpha * s))
    inertia = np.array([1.0, 1.0, 1.0 + 1.0 / scanner.mass_ratio])
    stiffness = eta**2 + np.array([0.0, 0.0, (2.0 * np.pi * cantilever.f_c * time) ** 2 / scanner.mass_ratio])
    U = inertia * (-c * e - cdot * e_rate + v) + acceleration + stiffness * x + 2.0 * xi * eta * x_rate
    sensitivity = np.array([p.piezo.sensitivity_x, p.piezo.sensitivity_y, p.piezo.sensitivity_z])
    return U * length / (eta**2 * sensitivity)


def answer(law: dict[str, object], **measured: object) -> np.ndarray:
    """Drive [V] that a law with these parameters answers to a measurement with these fields, zero in all others."""
    return Controller(build(ControllerParameters, law)).answer(array_of(record_of(Measurement, **measured)))


parameters = st.fixed_dictionaries(
    {
        "law.kind": st.sampled_from(["sgn", "tanh"]),
        "law.z_rate": st.sampled_from(["sample", "tip"]),
        **{f"law.{name}": st.floats(0.1, 10.0) for name in ("c_x", "cdot_x", "c_y", "cdot_y", "c_z", "cdot_z")},
        **{f"law.{name}": st.just(0.0) | st.floats(1e-9, 20.0) for name in ("M_x", "M_y", "M_z")},
        **{f"law.{name}": st.floats(1.0, 100.0) for name in ("alpha", "alpha_z")},
        **{f"scanner.f_{axis}": st.floats(100.0, 2000.0) for axis in "xyz"},
        **{f"scanner.xi_{axis}": st.just(0.0) | st.floats(1e-9, 0.5) for axis in "xyz"},
        **{f"piezo.sensitivity_{axis}": st.floats(1e-9, 1e-7) for axis in "xyz"},
        "scanner.mass_ratio": st.floats(10.0, 1000.0),
        "cantilever.a": st.floats(-1e-7, 1e-7).map(lambda a: a if abs(a) > 1e-15 else 0.0),
        "cantilever.f_c": st.floats(1e3, 1e5),
        "scales.w0": st.floats(1e3, 1e5),
    }
)
ones = st.floats(-1.0, 1.0)


@given(parameters, st.lists(ones, min_size=size(Measurement), max_size=size(Measurement)))
def test_answer_is_equation_6(values, numbers):
    # Positions of 20 x0 and a tenth of z0, with the rates that the scales give them.
    measurement = np.array(numbers)
    y = measurement.view(Measurement)[0]
    y.deflection *= 0.1 * Z0
    y.deflection_rate *= 0.1 * Z0 * W0
    for name, unit in (
        ("position", 1.0),
        ("velocity", W0),
        ("reference_position", 1.0),
        ("reference_velocity", W0),
        ("reference_acceleration", W0**2),
    ):
        y[name] *= np.array([20.0 * X0, 20.0 * X0, 0.1 * Z0]) * unit
    p = build(ControllerParameters, values)
    drive = Controller(p).answer(measurement)
    expected = equation_6(p, y)
    assert np.isfinite(drive).all()
    # Dozens of operations on terms that may cancel; the volts are of the order 1 to 1e3.
    assert drive == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_open_loop_drives_with_the_reference_as_a_force_and_keeps_z():
    drive = answer(
        {"law.kind": "open_loop"},
        reference_position=(20.0 * X0, -10.0 * X0, 5.0),
        position=(1.0, 1.0, 1.0),
        drive=(7.0, 8.0, -1.25),
    )
    eta = 2.0 * np.pi * np.array([669.07, 407.07]) / W0
    assert drive[:2] == pytest.approx(np.array([20.0, -10.0]) / eta**2 * X0 / 20e-9, rel=1e-13)
    assert drive[2] == -1.25


def test_a_force_of_20_moves_the_free_scanner_by_113_x0_along_x_and_306_x0_along_y():
    drive = answer({"law.kind": "open_loop"}, reference_position=(20.0 * X0, 20.0 * X0, 0.0))
    # Volts are static displacement over sensitivity; three digits are given.
    assert drive[:2] * 20e-9 / X0 == pytest.approx([113.0, 306.0], abs=0.5)


@given(st.floats(-1e6, 1e6), st.floats(0.1, 100.0))
def test_sgn_and_tanh_are_what_they_are_called(s, alpha):
    assert switching(SGN, s, alpha) == np.sign(s)
    assert switching(TANH, s, alpha) == pytest.approx(math.tanh(alpha * s), rel=1e-14)


def test_sgn_by_hand():
    position = (2.0 * X0, 0.0, 0.0)
    drive = answer({"law.kind": "sgn"}, position=position, velocity=(-1.0 * X0 * W0, 0.0, 0.0))
    # e = 2, e' = -1: s = 0.5 * 2 - 1 = 0 and U = -2 + 1 + eta^2 2 - 2 xi eta + 0.
    eta = 2.0 * math.pi * 669.07 / W0
    assert drive[0] / X0 * eta**2 * 20e-9 == pytest.approx(-1.0 + 2.0 * eta**2 - 2.0 * 0.0366 * eta, rel=1e-12)
    drive = answer({"law.kind": "sgn"}, position=position)
    # s = 1: U = -2 + 2 eta^2 - 15.
    assert drive[0] / X0 * eta**2 * 20e-9 == pytest.approx(-17.0 + 2.0 * eta**2, rel=1e-12)


def test_tanh_becomes_sgn_as_it_steepens():
    measured = {"position": (0.3 * X0, -0.2 * X0, 0.0), "deflection": 0.1 * Z0}
    steep = answer({"law.alpha": 1e4, "law.alpha_z": 1e4}, **measured)
    sgn = answer({"law.kind": "sgn"}, **measured)
    assert steep == pytest.approx(sgn, rel=1e-14)  # tanh(1e3) is 1 to the last bit


def test_new_parameters_hold_from_the_next_answer_on():
    y = array_of(record_of(Measurement, position=(X0, 0.0, 0.0)))
    law = Controller(ControllerParameters())
    before = law.answer(y).copy()
    law.parameters = build(ControllerParameters, {"law.M_x": 5.0})
    assert law.parameters.law.M_x == 5.0
    assert law.answer(y)[0] != before[0]
    law.parameters = ControllerParameters()
    np.testing.assert_array_equal(law.answer(y), before)


def test_answer_does_not_change_the_measurement(rng):
    y = rng.normal(size=size(Measurement)) * 1e-9
    kept = y.copy()
    Controller(ControllerParameters()).answer(y)
    np.testing.assert_array_equal(y, kept)


@pytest.mark.parametrize(("period", "diverges"), [(2e-6, ""), (5e-5, ""), (1e-4, "z"), (2e-4, "xyz")])
def test_a_rate_at_which_the_loop_diverges_is_told_by_axis_number_and_limit(period, diverges):
    controller = build(ControllerParameters, {"law.alpha": 0.01})
    told = registry.find("law", "tanh").warnings(controller, period)
    assert [sentence[:7] for sentence in told] == [f"along {axis}" for axis in diverges]
    if diverges:
        assert f"law.cdot_z w0 plant.control_period = {3e4 * period:.3g} must be < 2" in told[-1]
    run = build(SimParameters, {"run.duration": 0.05, "plant.control_period": period})
    if diverges:
        with pytest.raises(DivergenceError, match=r"first along .*z"):
            simulate(run, controller)
    else:
        simulate(run, controller)


def test_an_alpha_that_chatters_at_this_rate_is_told():
    law = registry.find("law", "tanh")
    assert law.warnings(build(ControllerParameters, {"law.alpha": 10.0}), 2e-6) == []
    (sentence,) = law.warnings(build(ControllerParameters, {"law.alpha": 20.0}), 2e-6)
    assert "law.alpha w0 plant.control_period = 0.4 should be <= 0.2" in sentence
