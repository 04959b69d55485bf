"""Claims about a cantilever whose base is moved, docs/lever.md (38), (39)."""

import math
from typing import Any

import numpy as np
import pytest

from afm_model import Instrument, ParameterError, build
from afm_model.cantilever import beam
from afm_model.compiled.records import size
from afm_model.parameters import InstrumentParameters
from afm_model.parts import Onboard, OnboardParameters, Record, kernel

AMPLITUDE, PHASE, Q = 1e-11, 0.7, 30.0
FREE = {"plant.kind": "lever", "sample.kind": "flat", "plant.gap": 1e-6, "plant.Q": Q, "plant.control_period": 1e-5}


class Shake(Record):
    amplitude: float
    angular_frequency: float
    phase: float
    until: float


class Shaker(OnboardParameters):
    """A dither piezo at the resonance of a mode, until some time."""

    mode: int = 0
    amplitude: float = AMPLITUDE
    until: float = 1e9


def _values(parameters: Any) -> dict[str, float]:
    shaker, f0 = parameters.onboard, parameters.plant.cantilever_numbers.f0
    w = 2.0 * math.pi * f0 * beam.MODE[shaker.mode].frequency
    return {"amplitude": shaker.amplitude, "angular_frequency": w, "phase": PHASE, "until": shaker.until}


@kernel
def _shake(t, d, r, u, p, s):
    u.amplitude = p.amplitude if t < p.until else 0.0
    u.angular_frequency, u.phase, u.since = p.angular_frequency, p.phase, 0.0


SHAKER = Onboard(name="shaker", parameters=Shaker, constants=Shake, values=_values, regulate=_shake, excites=True)


def motion(ticks: int, **values: Any) -> tuple[Instrument, Any]:
    """The instrument, and the states of its plant, tick by tick."""
    parameters = build(InstrumentParameters, FREE | {"onboard.kind": f"{__name__}:SHAKER"} | values)
    scope = Instrument(parameters, ticks)
    drive = scope.drive
    for _ in range(ticks):
        scope.tick(drive)
    states = scope.take_block().states
    plant = scope._layout.parts["plant"].part
    return scope, np.ascontiguousarray(states[:, : size(plant.state)]).view(plant.state.dtype)[:, 0]


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_free_cantilever_answers_its_base_by_Q_a_quarter_of_a_period_late_at_each_resonance(mode):
    dt = 2.5e-7
    values = {"plant.modes": 3, "plant.dt": dt, "detector.sample_period": 1e-6, "onboard.mode": mode}
    scope, states = motion(1500, **values)
    w = 2.0 * math.pi * scope.parameters.plant.cantilever_numbers.f0 * beam.MODE[mode].frequency
    # After more than twenty times its decay time, 2 Q / w.
    t = np.arange(1500) * scope.parameters.plant.control_period
    late = t * w > 40.0 * Q
    assert late.sum() > 100
    columns = np.column_stack([np.cos(w * t[late]), np.sin(w * t[late])])
    of_cos, of_sin = np.linalg.lstsq(columns, states["q"][late, mode], rcond=None)[0]
    gain = beam.MODE[mode].base
    assert math.hypot(of_cos, of_sin) == pytest.approx(abs(gain) * Q * AMPLITUDE, rel=1e-3)
    # q = Gamma Q B cos(w t + phase - pi/2).
    assert complex(of_cos, -of_sin) / (gain * Q * AMPLITUDE) == pytest.approx(
        np.exp(1j * (PHASE - 0.5 * math.pi)), abs=1e-3
    )


def test_tip_moves_with_its_base_and_the_photodiode_shows_the_deflection_alone():
    scope, states = motion(50, **{"plant.modes": 1, "plant.tilt": 0.2, "onboard.amplitude": 1e-9})
    q, tip = states["q"][-1, 0], states["tip"][-1]
    w = 2.0 * math.pi * scope.parameters.plant.cantilever_numbers.f0
    base = 1e-9 * math.cos(PHASE + w * 49 * scope.parameters.plant.control_period)
    c = scope._layout.record(scope._block, "plant_constants")
    assert tip - c.mode_z[0] * q == pytest.approx(math.cos(0.2) * base + c.rest_zz * states["F_z"][-1], abs=1e-15)
    assert states["shown"][-1] == pytest.approx(c.mode_shown[0] * q + c.shown_z * states["F_z"][-1], abs=1e-16)


def test_base_that_is_not_moved_changes_no_bit():
    still, _ = motion(50, **{"onboard.amplitude": 0.0})
    none, _ = motion(50, **{"onboard.kind": "none"})
    assert still.trajectory_sha256() == none.trajectory_sha256()
    moved, _ = motion(50)
    assert moved.trajectory_sha256() != none.trajectory_sha256()


@pytest.mark.parametrize("kind", ["compliant", "paper"])
def test_plant_whose_cantilever_cannot_be_excited_refuses_it_in_words(kind):
    parameters = build(InstrumentParameters, {"plant.kind": kind, "onboard.kind": f"{__name__}:SHAKER"})
    with pytest.raises(ParameterError, match=f"not allowed with plant.kind = {kind}, whose cantilever cannot be"):
        Instrument(parameters)
