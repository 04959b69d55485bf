"""Claims about what a tick measures of the motion."""

import math

import numpy as np
import pytest

from .. import session


def test_detector_reads_deflection_and_lateral_force_in_volts():
    values = {"sample.beta": 0.0, "cantilever.a": 3e-9, "reference.z_r": 1e-9, "plant.control_period": 5e-6}
    scope = session.instrument(values)
    y = session.measured(scope)
    # -2 nm at 10 nm/V.
    assert y.deflection_voltage == pytest.approx(-0.2, rel=1e-9)
    drive = scope.drive
    drive[0] = 12.0 / (2.0 * math.pi * 669.07 / 1e4) ** 2 * session.X0 / 20e-9
    scope.tick(drive)
    # A push of U = 12 along x, held by friction: 12 units of 15 nN on the tip along x, at 50 nN/V.
    assert y.lateral_voltage == pytest.approx(12.0 * 15.0 / 50.0, rel=1e-9)
    assert y.lateral_force == pytest.approx(12.0 * session.LATERAL, rel=1e-9)
    assert y.velocity[0] == 0.0


@pytest.mark.parametrize("push", [1.5, -1.5])
def test_lateral_force_on_the_tip_is_all_the_friction_there_is_along_the_motion_of_the_sample(push):
    scope = session.instrument({"plant.control_period": 5e-6})
    drive = np.add(scope.drive, [push, 0.0, 0.0])
    for _ in range(400):
        scope.tick(drive)
    block = scope.take_block()
    y, truth = block.measurements, scope.truth_of(block.states)
    velocity = y.velocity[:, 0]
    moved = velocity != 0.0
    # The push moves it its own way, for half a period at 669 Hz, and it rests where it stops.
    assert np.count_nonzero(moved) * 5e-6 == pytest.approx(0.5 / 669.07, rel=0.02)
    assert (np.sign(velocity[moved]) == np.sign(push)).all()
    # Across the push there is no motion, so that friction has no other component.
    assert y.lateral_force[moved] == pytest.approx(np.sign(push) * truth.friction_bound[moved], rel=1e-12)
    assert abs(y.lateral_force[-1]) < truth.friction_bound[-1]
