"""Claims about Read: values that have settled, of every sample, for a host that reads seldom."""

import cmath
import math

import numpy as np
import pytest
from quick_lever import KNOWN, LAW

from afm_model import ControllerParameters, SimParameters, build, changed
from afm_model.microscope import Local, MoveTo, Read

from ..onboard.test_dynamic import F0, Q, shown
from .test_tune import DRIVEN

DECAY, LOCK_IN = Q / (math.pi * F0), 40e-6
VALUES = DRIVEN | {"plant.Q": Q, "plant.f0": F0, "plant.modes": 3, "onboard.time_constant": LOCK_IN}


def driven(**values: float | str) -> Local:
    changes = {name.replace("__", "."): value for name, value in values.items()}
    return Local(build(SimParameters, VALUES | changes), build(ControllerParameters, LAW | KNOWN))


@pytest.mark.parametrize("r", [0.99, 1.0, 1.01])
def test_values_are_those_of_the_closed_form_and_do_not_change_any_more(r):
    microscope = driven(onboard__drive_frequency=r * F0)
    outcome = microscope.execute(Read())
    assert (outcome.status, outcome.message) == ("complete", "")
    found, closed = outcome.result.variables, 1e-11 * shown(r * F0)
    assert found["amplitude"].values == pytest.approx(abs(closed), rel=2e-3)
    assert found["phase"].values == pytest.approx(-cmath.phase(closed), abs=3e-3)
    assert {name: each.attributes["units"] for name, each in found.items()} == {
        "in_phase": "m",
        "quadrature": "m",
        "deflection": "m",
        "amplitude": "m",
        "phase": "rad",
    }
    told = outcome.result.attributes
    assert math.hypot(told["in_phase_change"], told["quadrature_change"]) < 2e-5 * abs(closed)
    # As long as it says: 12 decay times and (12 + 2n) time constants, and the mean as long again.
    assert microscope.instrument.time == pytest.approx(2.0 * (12.0 * DECAY + 20.0 * LOCK_IN), abs=3e-4)


def test_what_has_not_settled_is_told_by_its_change():
    microscope = driven()
    microscope.execute(MoveTo(x=1e-9))  # settled
    view = microscope.instrument
    view.set_onboard(changed(view.parameters, {"onboard.drive_amplitude": 2e-11}))
    halves = Read(settle=2e-3, average=1e-3, channels="amplitude")
    result = microscope.execute(halves).result
    # What is left of a step of a resonance, behind four low-passes: (1 - x)^-4 exp(-t / DECAY), x = LOCK_IN / DECAY.
    size, x = 1e-11 * abs(shown(F0)), LOCK_IN / DECAY
    rest = [size * (1.0 - x) ** -4 * _mean(*half) for half in ((2.0e-3, 2.5e-3), (2.5e-3, 3.0e-3))]
    assert result.attributes["amplitude_change"] == pytest.approx(rest[0] - rest[1], rel=0.03)
    assert result.variables["amplitude"].values == pytest.approx(2.0 * size - 0.5 * sum(rest), rel=2e-3)


def _mean(begin: float, end: float) -> float:
    """Of the decay of the cantilever from one time to another [s]."""
    return DECAY * (math.exp(-begin / DECAY) - math.exp(-end / DECAY)) / (end - begin)


def test_noise_of_the_photodiode_averages_out_as_it_does_of_white_noise():
    microscope = driven(onboard__drive_amplitude=0.0, detector__noise=1e-3)
    read = Read(channels="deflection_voltage", settle=1e-4, average=4e-3)
    values = [float(microscope.execute(read).result.variables["deflection_voltage"].values) for _ in range(60)]
    assert np.std(values) == pytest.approx(1e-3 / math.sqrt(4e-3 / 2e-6), rel=0.3)


@pytest.mark.parametrize(
    ("verb", "told"),
    [
        (Read(channels="amplitud"), "there is no amplitud (did you mean amplitude?)"),
        (Read(channels=" , "), "channels is empty: it must name one at least"),
        (Read(average=1e-5), "average = 1e-05 s is not allowed: it must be >= 0.0002 s, two control ticks"),
    ],
)
def test_what_cannot_be_read_is_refused_in_a_sentence(verb, told):
    assert told in driven().objection(verb)
