"""Claims about what a microscope says of itself: photodiode at its end, loop that oscillates, tip pressed or lost."""

import warnings

import pytest
from quick_lever import PRESSED

from afm_model import ParameterError
from afm_model.core.errors import VerbError
from afm_model.microscope import Microscope

FAST = {"rate": 20e-6, "range": 2e-6, "settle": 5e-3}


@pytest.fixture
def microscope():
    with Microscope("two_materials") as made:
        yield made


def test_a_setpoint_that_the_photodiode_cannot_read_is_refused_and_one_of_nothing_is_set(microscope):
    with pytest.raises(
        ParameterError, match=r"a setpoint of 4\.\d+e\+09 V is not allowed: the detector saturates at 50 V"
    ):
        microscope.set_setpoint(force=10.0)
    with pytest.raises(ParameterError, match=r"a setpoint of -60 V is not allowed"):
        microscope.set_setpoint(voltage=-60.0)
    with pytest.raises(
        ParameterError, match=r"a setpoint of 4\.\d+e\+08 V is not allowed: the photodiode reads \+-50 V"
    ):
        Microscope("two_materials", onboard={"setpoint_force": 1.0})
    microscope.approach(**FAST)
    for force in (-3e-9, 0.0):
        microscope.set_setpoint(force=force)
        stands = microscope.move_to(x=10e-9 + force, y=0.0, speed=0.1e-6)
        assert microscope.state.setpoint == pytest.approx(force * PRESSED / 10e-9)
        assert stands.deflection_voltage == pytest.approx(force * PRESSED / 10e-9, abs=0.1)
    assert microscope.state.setpoint == 0.0
    assert microscope.state.approached


def test_a_force_curve_that_the_photodiode_clips_says_so(microscope):
    microscope.backend.exchange("detector", {"range": 10.0})
    microscope.approach(**FAST)
    with pytest.warns(UserWarning, match=r"the photodiode was at the end of its range in \d+ samples"):
        curve = microscope.force_curve(ramp=400e-9, lift=200e-9, approach_rate=20e-6, retract_rate=20e-6)
    assert float(curve.deflection_voltage.max()) == 10.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        microscope.force_curve(trigger_force=5e-9, approach_rate=20e-6, retract_rate=20e-6)


def test_a_loop_that_oscillates_is_told_when_its_gains_are_set_and_when_it_scans(microscope):
    microscope.approach(**FAST)
    with pytest.warns(UserWarning, match=r"makes the z loop oscillate"):
        microscope.set_gains(integral=40e-6)
    with pytest.warns(UserWarning, match=r"the z loop did not hold the setpoint of 4\.\d+ V: its error was .* V rms"):
        microscope.scan(size_x=50e-9, pixels=16, lines=4, line_rate=20.0)
    with warnings.catch_warnings(), Microscope("two_materials") as steady:
        warnings.simplefilter("error")
        steady.approach(**FAST)
        steady.set_gains(integral=8e-6)
        steady.scan(size_x=50e-9, pixels=16, lines=4, line_rate=20.0)


def test_a_loop_on_its_way_to_another_setpoint_is_not_one_that_oscillates(microscope):
    microscope.approach(**FAST)
    for force in (0.0, 30e-9):
        microscope.set_setpoint(force=force)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            microscope.scan(size_x=50e-9, pixels=16, lines=2, line_rate=20.0)


def test_an_approach_that_presses_the_tip_in_is_not_one_without_a_sample():
    # Half of the light is lost: at the end of its way the photodiode reads half of what it should.
    with Microscope("two_materials", detector={"deflection_gain": 0.5, "range": 10.0}) as microscope:
        microscope.set_setpoint(voltage=9.9)
        with pytest.raises(
            VerbError, match=r"pressed into the sample: z went 6e-07 m .* was [45]\.\d+ V over its rest"
        ):
            microscope.approach(rate=20e-6, range=600e-9, settle=5e-3)
        assert not microscope.state.near
        with pytest.raises(VerbError, match=r"no sample within range = 2e-07 m: z went 2e-07 m"):
            microscope.approach(rate=20e-6, range=200e-9, settle=5e-3)


def test_a_tip_that_is_lost_is_approached_no_more_and_feedback_is_off_behind_a_withdrawal(microscope):
    microscope.approach(**FAST)
    assert (microscope.state.approached, microscope.state.feedback) == (True, "on")
    microscope.withdraw()
    assert (microscope.state.approached, microscope.state.feedback) == (False, "off")
    # The sample drifts away, further than z goes.
    with Microscope("two_materials", drift={"rate_z": -1e-6}, onboard={"high": 200e-9}) as lost:
        lost.approach(**FAST)
        assert lost.state.approached
        with pytest.warns(UserWarning, match="the tip is off the sample at the end"):
            lost.move_to(x=20e-6, y=0.0, speed=100e-6)
        assert not lost.state.approached
        with pytest.raises(VerbError, match="while the tip is withdrawn: it must be approached first"):
            lost.scan()
