"""Claims about tapping: the loop of the amplitude, the approach by it, setpoints in metres and as a share."""

import numpy as np
import pytest

from afm_model import InstrumentParameters, ParameterError, build
from afm_model.compiled.jit import plain
from afm_model.microscope import Approach, ForceCurve, FrictionLoop, Local, MoveTo, Tune, Withdraw
from afm_model.onboard import DYNAMIC
from afm_model.parts.signals import Actuation, Detection, Setpoint

from ..onboard.test_dynamic import FREE
from .test_amplitude_curve import DRIVE, GAIN, GAP, SHOWN, Q, distance, tapping

VOLT = 10e-9
FREE_TIP = GAIN * Q * DRIVE
NEAR = Approach(rate=2e-6, range=60e-9, settle=10e-3)
LAG = Q / (np.pi * 77e3) + 4 * 50e-6


def tapped(**values: float | str) -> Local:
    """A microscope whose z loop regulates the amplitude."""
    own = {"onboard__regulate": "amplitude", "onboard__setpoint_force": 0.0, "onboard__integral_gain": 10e-6}
    return tapping(**own | values)


def amplitude(microscope: Local) -> float:
    """Of the end of the cantilever, as the lock-in shows it [m]."""
    return float(microscope.instrument.orders.onboard.amplitude) * VOLT / SHOWN


def test_loop_holds_the_amplitude_where_the_attraction_leaves_it_by_closed_form():
    microscope = tapped(onboard__setpoint_share=0.9)
    z0 = microscope.instrument.orders.onboard.z
    outcome = microscope.execute(NEAR)
    assert (outcome.status, outcome.message) == ("complete", "")
    part = microscope.instrument.parameters.onboard
    assert part.free_amplitude / SHOWN == pytest.approx(FREE_TIP, rel=2e-3)
    for share in (0.9, 0.8, 0.7):
        microscope.set_setpoint(share=share)
        microscope.execute(MoveTo(x=0.0 if microscope.state.place[0] else 1e-9, speed=0.1e-6))
        assert amplitude(microscope) == pytest.approx(share * FREE_TIP, rel=2e-3)
        zc = GAP - (microscope.instrument.orders.onboard.z - z0)
        assert zc == pytest.approx(distance(share * FREE_TIP), abs=0.03e-9)
    # In metres it is the same, and stands in the state as volts of the photodiode.
    microscope.set_setpoint(amplitude=0.8 * part.free_amplitude)
    assert microscope.state.setpoint == pytest.approx(0.8 * part.free_amplitude / VOLT, rel=1e-12)
    microscope.execute(MoveTo(x=0.0, speed=0.1e-6))
    zc = GAP - (microscope.instrument.orders.onboard.z - z0)
    assert zc == pytest.approx(distance(0.8 * FREE_TIP), abs=0.03e-9)
    microscope.execute(Withdraw(distance=100e-9))
    assert not microscope.state.near
    assert amplitude(microscope) == pytest.approx(FREE_TIP, rel=0.02)


@pytest.mark.parametrize("setpoint", [{"setpoint_amplitude": 8e-9}, {"setpoint_share": 0.4, "free_amplitude": 20e-9}])
def test_sample_comes_nearer_by_the_integral_of_what_the_amplitude_is_above_its_setpoint(setpoint):
    values = {"regulate": "amplitude", "integral_gain": 2e-3, "high": 1e-8, **setpoint}
    values = {f"onboard.{name}": each for name, each in values.items()} | {"detector.sample_period": 5e-6}
    parameters = build(InstrumentParameters, FREE | values)
    p, s = np.zeros(1, DYNAMIC.constants.dtype)[0], np.zeros(1, DYNAMIC.state.dtype)[0]
    for name, value in DYNAMIC.values(parameters).items():
        p[name] = value
    p, s = p.view(np.recarray), s.view(np.recarray)
    d, r, u = (np.zeros(1, kind.dtype).view(np.recarray)[0] for kind in (Detection, Setpoint, Actuation))
    for volts, high in ((0.9, True), (0.0, False)):
        for k in range(1000):
            d.deflection_voltage = volts * np.cos(2.0 * np.pi * 26e3 * k * 5e-6)
            z = float(s.z)
            plain(DYNAMIC.regulate)(k * 5e-6, d, r, u, p, s)
            assert s.error == pytest.approx(float(s.amplitude) - 0.8, abs=1e-15)
            assert d.amplitude_voltage == s.amplitude
            inside = -5e-6 < s.z < 1e-8
            assert float(s.z) - z == pytest.approx(2e-3 * 5e-6 * float(s.error), abs=1e-20) or not inside
        # At its limit z stays, and leaves it with the first sample of the other sign: nothing has wound up.
        assert (s.z == 1e-8) == high


def test_what_cannot_be_approached_by_amplitude_is_said_in_words():
    assert "onboard.drive_amplitude = 0: nothing drives the tip" in tapped(onboard__drive_amplitude=0.0).objection(NEAR)
    high = tapped(onboard__setpoint_amplitude=12e-9)
    outcome = high.execute(NEAR)
    assert outcome.status == "failed"
    assert "the free amplitude is 9.4" in outcome.message
    assert "the setpoint 1.2e-08 m: it must be lower" in outcome.message
    assert not high.state.near
    fast = tapped(onboard__setpoint_amplitude=5e-9)
    most = 5e-9 / LAG
    told = f"rate = {1.01 * most:g} m/s is not allowed: the amplitude is 0.00045 s late"
    assert told in fast.objection(NEAR.model_copy(update={"rate": 1.01 * most}))
    assert fast.objection(NEAR.model_copy(update={"rate": 0.99 * most})) == ""


def test_no_sample_in_range_withdraws_and_says_how_far_the_amplitude_fell():
    microscope = tapped()
    z = microscope.instrument.orders.onboard.z
    outcome = microscope.execute(NEAR.model_copy(update={"range": 20e-9}))
    assert outcome.status == "failed"
    assert "no sample within range = 2e-08 m: z went 2e-08 m without the amplitude falling to the" in outcome.message
    # To where half of what it is to fall by is left.
    way = GAP - distance(0.9 * FREE_TIP) + 2e-6 * LAG
    outcome = microscope.execute(NEAR.model_copy(update={"range": way}))
    assert "at the end it was " in outcome.message and "take a larger range" in outcome.message
    assert not microscope.state.near and not microscope.instrument.in_contact
    assert microscope.instrument.orders.onboard.z == pytest.approx(z, abs=1e-15)


def test_tip_that_taps_is_approached_though_it_hardly_touches_and_lost_where_its_amplitude_is_free():
    # The sample goes away from it, and the loop follows until it is held.
    microscope = tapped(drift__rate_z=-2e-7)
    microscope.execute(NEAR)
    assert microscope.state.approached and not microscope.instrument.in_contact
    assert "FrictionLoop is not allowed with onboard.regulate = amplitude" in microscope.objection(FrictionLoop())
    assert "needs a tip that is pressed on the sample" in microscope.objection(ForceCurve())
    microscope.set_feedback("hold")
    assert microscope.state.approached
    microscope.execute(MoveTo(x=1e-9, speed=2e-8))
    assert not microscope.state.approached


def test_tune_tells_the_loop_the_free_amplitude_that_it_sets():
    microscope = tapped()
    assert microscope.state.setpoint == 0.0
    microscope.execute(Tune(points=16, average=2e-4, free_amplitude=8e-9))
    assert microscope.instrument.parameters.onboard.free_amplitude == 8e-9
    assert microscope.state.setpoint == pytest.approx(0.8 * 8e-9 / VOLT)
    microscope.set_setpoint(amplitude=7e-9)
    told = microscope.objection(Tune(free_amplitude=6e-9))
    assert "onboard.setpoint_amplitude = 7e-09 m is not allowed: it must be < the free amplitude, 6e-09 m" in told


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"setpoint_force": 1e-9}, "onboard.setpoint_force = 1e-09 is not allowed with onboard.regulate = amplitude"),
        ({"regulate": "deflection", "setpoint_share": 0.5}, "onboard.setpoint_share = 0.5 is not allowed with onboard"),
        ({"setpoint_amplitude": 1e-9, "setpoint_share": 0.5}, "are not allowed together: give one"),
        ({"setpoint_share": 1.0}, "onboard.setpoint_share = 1.0 is not allowed"),
        ({"setpoint_amplitude": 2e-9, "free_amplitude": 1e-9}, "it must be < the free amplitude, 1e-09 m"),
        ({"lock_in": "lateral"}, "onboard.lock_in = lateral is not allowed with onboard.regulate = amplitude"),
        ({"harmonic": 2}, "onboard.harmonic = 2 is not allowed with onboard.regulate = amplitude: take 1"),
        ({"regulate": "phase"}, "onboard.regulate = phase is not allowed"),
    ],
)
def test_settings_that_contradict_are_refused(values, told):
    values = {"regulate": "amplitude"} | values
    with pytest.raises(ParameterError, match=told):
        build(InstrumentParameters, FREE | {f"onboard.{name}": each for name, each in values.items()})


def test_setpoint_of_an_amplitude_is_one_positive_number():
    microscope = tapped()
    for given, told in (({"share": 0.0}, "share = 0 is not allowed: it must be > 0"), ({}, "give one of them")):
        with pytest.raises(ParameterError, match=told):
            microscope.set_setpoint(**given)
    with pytest.raises(ParameterError, match=r"onboard\.setpoint_force = 1e-09 is not allowed"):
        microscope.set_setpoint(force=1e-9)


def test_gain_that_makes_the_loop_oscillate_is_told():
    def told(gain: float) -> list[str]:
        return DYNAMIC.warnings(tapped(onboard__integral_gain=gain).instrument.parameters)

    # A quarter of a turn late: bisected apart, with angles.
    own = Q / (np.pi * 77e3)
    low, high = 0.0, 1e5
    for _ in range(80):
        w = 0.5 * (low + high)
        low, high = (w, high) if np.arctan(w * own) + 4.0 * np.arctan(w * 50e-6) < 0.5 * np.pi else (low, w)
    most = VOLT * w * np.hypot(1.0, w * own) * np.hypot(1.0, w * 50e-6) ** 4
    assert told(0.98 * most) == []
    assert "makes the z loop oscillate" in told(1.03 * most)[0]
