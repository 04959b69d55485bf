"""Claims about the preview of the reference: it is what is measured later, and what its closed form says."""

import sys
from types import ModuleType

import numpy as np
import pytest

from afm_model import Instrument, ParameterError, PartError, SimParameters, build, preview_reference
from afm_model.instrument.preview import MOST
from afm_model.parts import Program, ProgramParameters

PERIOD = 1e-4
SHAPES = {"reference.shape_x": "triangle", "reference.amplitude_y": 2e-9, "reference.omega_y": 75.0}
FIELDS = ("position", "velocity", "acceleration")


def parameters(**values: object) -> SimParameters:
    return build(SimParameters, {"plant.control_period": PERIOD} | {k.replace("__", "."): v for k, v in values.items()})


def measured(sim: SimParameters, ticks: int) -> dict[str, np.ndarray]:
    """Reference in the measurements of the first ticks, under the drive of the start."""
    instrument = Instrument(sim, ticks, hashed=False)
    for _ in range(ticks):
        instrument.tick(instrument.drive)
    records = instrument.take_block().measurements
    return {name: records[f"reference_{name}"] for name in FIELDS}


@pytest.mark.parametrize("values", [{}, SHAPES, {"reference.shape_x": "constant", "reference.z_r": 1e-12}])
def test_preview_is_what_will_be_measured_to_the_last_bit(values):
    sim = build(SimParameters, {"plant.control_period": PERIOD} | values)
    seen, preview = measured(sim, 700), preview_reference(sim, 100, 600)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(preview, name), seen[name][100:])


def test_preview_is_that_of_the_closed_form_far_ahead_and_behind():
    preview = preview_reference(build(SimParameters, {"plant.control_period": PERIOD} | SHAPES), 10**7, 2000)
    t = (10**7 + np.arange(2000)) * PERIOD
    np.testing.assert_allclose(preview.time, t, rtol=1e-15)
    # At its corners arcsin has half of the digits.
    np.testing.assert_allclose(preview.position[:, 0], 5e-9 * 2.0 / np.pi * np.arcsin(np.sin(50.0 * t)), atol=2e-16)
    np.testing.assert_allclose(np.abs(preview.velocity[:, 0]), 5e-9 * 50.0 * 2.0 / np.pi, rtol=1e-12)
    assert not preview.acceleration[:, 0].any()
    for k, name in enumerate(FIELDS):
        expected = 2e-9 * 75.0**k * np.sin(75.0 * t + 0.5 * np.pi * k)
        np.testing.assert_allclose(getattr(preview, name)[:, 1], expected, atol=2e-9 * 75.0**k * 1e-10)


@pytest.mark.parametrize(
    ("first", "count", "words"),
    [
        (0, 0, "count = 0 is not allowed: it must be from 1 to"),
        (0, -1, "count = -1 is not allowed"),
        (0, MOST + 1, f"count = {MOST + 1} is not allowed: it must be from 1 to {MOST}"),
        (-1, 1, "first = -1 is not allowed: it must be from 0 to"),
        (2**53, 1, f"first = {2**53} is not allowed"),
        (2**64 - 1, 1, f"first = {2**64 - 1} is not allowed"),
    ],
)
def test_ticks_that_there_are_not_are_refused(first, count, words):
    with pytest.raises(ParameterError) as raised:
        preview_reference(parameters(), first, count)
    assert words in str(raised.value)


@pytest.mark.parametrize("kind", ["verbs", "force_curve"])
def test_reference_that_follows_orders_is_not_known_ahead(kind):
    sim = build(
        SimParameters,
        {"reference.kind": kind, "plant.kind": "lever", "plant.gap": 1e-8, "onboard.kind": "pi"},
    )
    with pytest.raises(ParameterError, match=rf"^reference.kind = {kind} is not known ahead: it does what is ordered"):
        preview_reference(sim, 0, 1)


class OwnParameters(ProgramParameters):
    """None of its own."""


def _own(t, r, p):
    if t > 9e-4:
        raise ValueError("too late")
    r.position[0], r.velocity[0] = 1e-6 * t, 1e-6


def test_program_of_ones_own_in_python_is_previewed_and_its_error_is_told(monkeypatch):
    module = ModuleType("own_program")
    module.PROGRAM = Program(name="own", parameters=OwnParameters, reference=_own)
    monkeypatch.setitem(sys.modules, "own_program", module)
    sim = parameters(reference__kind="own_program:PROGRAM")
    preview = preview_reference(sim, 3, 4)
    np.testing.assert_array_equal(preview.position[:, 0], 1e-6 * (PERIOD * np.arange(3, 7)))
    with pytest.raises(PartError, match="too late"):
        preview_reference(sim, 3, 20)
