"""Claims about the shaker and the lock-in of dynamic modes, against closed forms; docs/dynamic.md."""

import cmath
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.special import betainc

from afm_model import Instrument, ParameterError, build, changed
from afm_model.compiled.jit import plain
from afm_model.compiled.records import size
from afm_model.onboard.dynamic import DYNAMIC, late, mixed
from afm_model.parameters import InstrumentParameters
from afm_model.parts.signals import Actuation, Detection, Setpoint

from ..clamped_mode import clamped_mode
from ..held import held

F0, Q, BASE, AHEAD, VOLT = 26e3, 30.0, 1e-11, 0.3, 10e-9
FREE = {
    "plant.kind": "lever",
    "plant.gap": 1e-6,
    "plant.hamaker": 1e-21,
    "plant.scanner": "stack_13um",
    "sample.kind": "flat",
    "onboard.kind": "dynamic",
    "detector.channels": "amplitude, phase, in_phase, quadrature",
}


def beam(number: int) -> tuple[float, float, float]:
    """Of a clamped beam's mode: frequency over that of the first, force of inertia of a moving base over that on its
    mass at the end, slope of the end times length.
    """
    mode = clamped_mode(number)
    return mode.over_first, mode.end * mode.mean / mode.mean_square, mode.slope / mode.end


def shown(f: float) -> complex:
    """Deflection that the photodiode shows over the motion of the base: the slope of three modes, times 2/3."""
    total = 0.0j
    for number in range(3):
        over_first, push, slope = beam(number)
        r = f / (F0 * over_first)
        total += 2.0 / 3.0 * slope * push * r * r / (1.0 - r * r + 1j * r / Q)
    return total


def record(ticks: int, **values: Any) -> tuple[Instrument, dict[str, np.ndarray], np.ndarray]:
    """The instrument, its channels by name, and the states of its plant, tick by tick."""
    parameters = build(InstrumentParameters, FREE | {name.replace("__", "."): each for name, each in values.items()})
    scope, read, block = held(parameters, ticks)
    return scope, read, block.states[:, : size(scope._layout.parts["plant"].part.state)]


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_free_resonance_curve_is_the_closed_form_within_1e_4_for_each_mode(mode):
    resonance = F0 * beam(mode)[0]
    dt, decay = 1.0 / (320 * resonance), Q / (math.pi * resonance)
    for r in (0.96, 1.0 - 0.5 / Q, 1.0, 1.0 + 0.5 / Q, 1.04):
        values = {"plant.dt": dt, "detector.sample_period": 20 * dt, "plant.control_period": 400 * dt, "plant.modes": 3}
        values |= {"plant.f0": F0, "plant.Q": Q, "onboard.time_constant": 0.5 * decay, "onboard.drive_phase": AHEAD}
        values |= {"onboard.drive_frequency": r * resonance, "onboard.drive_amplitude": BASE}
        _, read, _ = record(math.ceil(26.0 * decay / (400 * dt)), **values)
        # A cos(theta - phi) of a base that moves by B cos(theta + phase).
        closed = BASE * shown(r * resonance) * cmath.exp(1j * AHEAD)
        last = slice(-20, None)
        found = complex(read["in_phase"][last].mean(), -read["quadrature"][last].mean())
        assert found == pytest.approx(closed, rel=1e-4)
        assert read["amplitude"][last].mean() == pytest.approx(abs(closed), rel=1e-4)
        assert cmath.exp(-1j * read["phase"][-1]) == pytest.approx(closed / abs(closed), abs=2e-4)


def test_without_a_drive_no_bit_of_the_motion_is_another_than_with_the_z_loop_alone():
    touching = {"plant.gap": 0.0, "reference.z_r": 50e-9, "plant.hamaker": 1e-19, "onboard.integral_gain": 20e-6}
    touching |= {"onboard.setpoint_voltage": 5.2, "detector.channels": "z_loop", "plant.temperature": 295.0}
    _, _, alone = record(50, **touching, **{"onboard.kind": "pi"})
    _, _, both = record(50, **touching)
    assert np.array_equal(alone, both)
    _, _, driven = record(50, **touching, **{"onboard.drive_amplitude": BASE, "plant.dt": 2.5e-7})
    assert not np.array_equal(alone, driven)


def test_base_goes_on_without_a_jump_where_the_frequency_changes():
    scope, _, _ = record(7, **{"onboard.drive_amplitude": BASE, "plant.dt": 2.5e-7})
    drive, T = scope.drive, scope.parameters.detector.sample_period

    def angle(t: float) -> float:
        w = scope._layout.record(scope._block, "regulated")
        return float(w.phase + w.angular_frequency * (t - w.since))

    for f in (31e3, 11e3):
        before = angle(scope.time)
        scope.set_onboard(changed(scope.parameters, {"onboard.drive_frequency": f}))
        at = scope.time
        scope.tick(drive)
        turned = angle(at + T) - before - 2.0 * math.pi * f * T
        assert math.remainder(turned, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


def lock_in(deflection: Any, samples: int, **values: float) -> list[tuple[float, float]]:
    """x and y [V] after each sample of a deflection over theta [V], of the part alone."""
    given = {"onboard.drive_frequency": 1e4, "onboard.feedback": "hold", "detector.sample_period": 5e-6}
    parameters = build(InstrumentParameters, FREE | given | values)
    p, s = np.zeros(1, DYNAMIC.constants.dtype)[0], np.zeros(1, DYNAMIC.state.dtype)[0]
    for name, value in DYNAMIC.values(parameters).items():
        p[name] = value
    p, s = p.view(np.recarray), s.view(np.recarray)
    d, r, u = (np.zeros(1, kind.dtype).view(np.recarray)[0] for kind in (Detection, Setpoint, Actuation))
    found = []
    for k in range(samples):
        d.deflection_voltage = deflection(2.0 * math.pi * 1e4 * k * 5e-6)
        plain(DYNAMIC.regulate)(k * 5e-6, d, r, u, p, s)
        found.append((float(s.x), float(s.y)))
    return found


@pytest.mark.parametrize(("harmonic", "amplitude", "phase"), [(1, 0.7, 0.4), (2, 0.2, 2.5), (3, 0.05, -1.0)])
def test_lock_in_reads_amplitude_and_phase_of_its_harmonic_alone(harmonic, amplitude, phase):
    def deflection(theta: float) -> float:
        parts = ((1, 0.7, 0.4), (2, 0.2, 2.5), (3, 0.05, -1.0))
        return 0.3 + sum(a * math.cos(n * theta - phi) for n, a, phi in parts)

    values = {"onboard.harmonic": harmonic, "onboard.time_constant": 2e-4, "onboard.filter_order": 4}
    x, y = lock_in(deflection, 1200, **values)[-1]
    assert complex(x, y) == pytest.approx(amplitude * cmath.exp(1j * phase), abs=1e-4)


@pytest.mark.parametrize("offset", [0.9, -2.0, 4.0])
def test_phase_offset_is_taken_from_the_lag_and_changes_nothing_else(offset):
    def deflection(theta: float) -> float:
        return 0.7 * math.cos(theta - 0.4)

    values = {"onboard.time_constant": 2e-4, "onboard.filter_order": 4}
    plain_, turned = (lock_in(deflection, 1200, **values, **more) for more in ({}, {"onboard.phase_offset": offset}))
    assert complex(*turned[-1]) == pytest.approx(0.7 * cmath.exp(1j * (0.4 - offset)), abs=1e-4)
    assert complex(*turned[700]) == pytest.approx(complex(*plain_[700]) * cmath.exp(-1j * offset), rel=1e-13)
    touching = {"plant.gap": 0.0, "reference.z_r": 50e-9, "plant.hamaker": 1e-19, "onboard.drive_amplitude": 1e-10}
    touching |= {"plant.dt": 2.5e-7, "onboard.regulate": "amplitude", "onboard.setpoint_amplitude": 1e-9}
    _, one, motion = record(30, **touching)
    _, other, same = record(30, **touching, **{"onboard.phase_offset": offset})
    assert np.array_equal(motion, same)
    assert np.array_equal(one["amplitude"], other["amplitude"])
    # Of nothing, as in the first sample, the phase is 0.
    away = np.remainder(one["phase"] - offset - other["phase"] + 1.0, 2.0 * math.pi)[1:] - 1.0
    assert np.abs(away).max() < 1e-9
    assert other["phase"].min() >= -0.5 * math.pi and other["phase"].max() < 1.5 * math.pi


@pytest.mark.parametrize("order", [1, 2, 4, 8])
def test_filter_has_the_order_and_the_time_constant_that_are_stated(order):
    values = {"onboard.time_constant": 5e-4, "onboard.filter_order": order}
    cosine, sine = (lock_in(wave, 800, **values) for wave in (math.cos, math.sin))
    for k in (0, 20, 100, 400, 799):
        # Together 2 cos^2 and 2 sin^2 are a step: so many low-passes in a row answer it by a negative binomial law.
        assert 0.5 * (cosine[k][0] + sine[k][1]) == pytest.approx(betainc(order, k + 1, -math.expm1(-5e-6 / 5e-4)))


def test_host_that_reads_once_in_a_time_constant_sees_less_than_a_hundredth_of_what_it_would_fold():
    values = {"onboard.time_constant": 5e-4, "onboard.filter_order": 4}
    # 1/2T off the drive, whose frequency is 10 kHz.
    beside = lock_in(lambda theta: math.cos(1.1 * theta), 2400, **values)[1600:]
    size = math.sqrt(np.mean(np.square(beside).sum(axis=1)))
    assert size == pytest.approx((1.0 + math.pi**2) ** -2, rel=0.02)
    assert np.hypot(*np.transpose(beside)).max() < 0.01
    # Ten time constants after the begin, by the gamma law of four low-passes in a row.
    left = math.exp(-10.0) * (1.0 + 10.0 + 10.0**2 / 2.0 + 10.0**3 / 6.0)
    missing = 1.0 - abs(complex(*lock_in(math.cos, 1001, **values)[-1]))
    assert missing == pytest.approx(left, rel=0.05)


def test_phase_is_the_angle_from_minus_a_quarter_of_a_turn_on():
    for angle in np.linspace(-0.499 * math.pi, 1.499 * math.pi, 4001):
        assert plain(late)(3e-4 * math.cos(angle), 3e-4 * math.sin(angle)) == pytest.approx(angle, abs=2e-15)
    assert plain(late)(0.0, 0.0) == 0.0


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"plant.dt": 1e-6}, "plant.dt = 1e-06 s is not allowed with a drive of 26000 Hz, which it does not resolve"),
        ({"onboard.harmonic": 20}, "the lock-in needs 4 samples a period; take <= 4.81e-07 s"),
        ({"plant.kind": "compliant"}, "not allowed with plant.kind = compliant, whose cantilever cannot be excited"),
        ({"plant.kind": "paper"}, "not allowed with plant.kind = paper, whose cantilever cannot be excited"),
    ],
)
def test_what_cannot_be_resolved_or_excited_is_refused_in_a_sentence(values, told):
    fine = {
        "onboard.kind": "dynamic",
        "onboard.drive_amplitude": BASE,
        "plant.dt": 2.5e-7,
        "detector.sample_period": 1e-6,
    }
    lever = {"plant.kind": "lever", "sample.kind": "flat"} if "plant.kind" not in values else {}
    with pytest.raises(ParameterError, match=told):
        Instrument(build(InstrumentParameters, fine | lever | values))


@pytest.mark.parametrize(("samples", "folded"), [(4, 1.0), (8, 0.0), (16, 0.0)])
def test_third_harmonic_is_folded_onto_the_first_at_four_samples_a_period_and_not_at_eight(samples, folded):
    constants = SimpleNamespace(lateral=0.0, filter_order=4.0, share=1.0 - math.exp(-1.0 / (10.0 * samples)))
    stages = np.zeros((2, 4))
    for i in range(300 * samples):
        angle = 2.0 * math.pi * i / samples
        signal = SimpleNamespace(deflection_voltage=math.cos(angle) + 5e-3 * math.cos(3.0 * angle), lateral_voltage=0.0)
        x, y = plain(mixed)(signal, angle, *stages, constants)
    assert math.hypot(x, y) == pytest.approx(1.0 + 5e-3 * folded, abs=2e-4)
