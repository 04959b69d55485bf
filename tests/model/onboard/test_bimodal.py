"""Claims about two tones of the drive, each with a lock-in of its own, against closed forms; docs/dynamic.md."""

import cmath
import math
from typing import Any

import numpy as np
import pytest

from afm_model import Instrument, ParameterError, build, changed
from afm_model.microscope.verbs.scan import notes
from afm_model.onboard import BIMODAL
from afm_model.parameters import InstrumentParameters

from ..held import held
from .test_dynamic import AHEAD, BASE, F0, FREE, Q, beam, record, shown

SECOND = F0 * beam(1)[0]
SECOND_BASE = 0.4 * BASE
STEP = 1.0 / (320 * SECOND)
TWO = FREE | {
    "onboard.kind": "bimodal",
    "plant.f0": F0,
    "plant.Q": Q,
    "plant.modes": 3,
    "plant.dt": STEP,
    "detector.sample_period": 20 * STEP,
    "plant.control_period": 2000 * STEP,
    "onboard.drive_amplitude": BASE,
    "onboard.second_drive_amplitude": SECOND_BASE,
    "onboard.time_constant": 60e-6,
    "detector.channels": "in_phase, quadrature, second_in_phase, second_quadrature, second_amplitude, second_phase",
}
TAPS = {"onboard.regulate": "amplitude", "onboard.setpoint_amplitude": 1e-10}
SETTLING = 26.0 * Q / (math.pi * F0)


def settled(**values: Any) -> dict[str, np.ndarray]:
    """Channels of the free cantilever from the time on at which its motion has settled."""
    parameters = build(InstrumentParameters, TWO | {name.replace("__", "."): each for name, each in values.items()})
    _, read, _ = held(parameters, math.ceil(SETTLING / (2000 * STEP)) + 10)
    return {name: each[-1000:] for name, each in read.items()}


def responses(read: dict[str, np.ndarray]) -> tuple[complex, complex]:
    """Means of both lock-ins, A exp(-i phi) [m]."""
    means = {name: float(each.mean()) for name, each in read.items()}
    first = complex(means["in_phase"], -means["quadrature"])
    return first, complex(means["second_in_phase"], -means["second_quadrature"])


def passed(f: float, time_constant: float, order: int) -> float:
    """Of an oscillation [Hz], by so many low-passes of samples in a row."""
    keeps = math.exp(-20 * STEP / time_constant)
    return abs((1.0 - keeps) / (1.0 - keeps * cmath.exp(-2j * math.pi * f * 20 * STEP))) ** order


@pytest.mark.parametrize("r", [0.97, 1.0, 1.0 + 0.5 / Q])
def test_each_tone_is_answered_as_by_the_closed_form_of_all_modes_whatever_the_other_does(r):
    f_1, f_2 = r * F0, r * SECOND
    # The second one at the resonance of its mode by default.
    values = {"onboard__drive_frequency": f_1, "onboard__second_drive_frequency": f_2 if r != 1.0 else 0.0}
    first, second = responses(read := settled(**values, onboard__drive_phase=AHEAD))
    assert first / (BASE * shown(f_1) * cmath.exp(1j * AHEAD)) == pytest.approx(1.0, abs=1e-4)
    assert second / (SECOND_BASE * shown(f_2)) == pytest.approx(1.0, abs=1e-4)
    assert read["second_amplitude"].mean() == pytest.approx(abs(second), rel=1e-6)
    # Forces of inertia are the other way round there (38): late by three quarters of a turn, and not by minus one.
    assert read["second_phase"].mean() == pytest.approx(2.0 * math.pi - cmath.phase(second), abs=1e-5)
    # The same within what the low-passes let through of the other tone, and of its harmonic by the product.
    alone, none = responses(settled(**values, onboard__drive_phase=AHEAD, onboard__second_drive_amplitude=0.0))
    rejected = 2.0 * passed(f_2 - f_1, 60e-6, 4)
    assert rejected < 1e-6
    assert abs(alone - first) < rejected * abs(second)
    assert abs(none) < rejected * abs(first)


def test_second_tone_has_a_phase_of_its_own_and_its_lock_in_an_offset():
    turned = {"onboard__second_drive_phase": 0.7, "onboard__second_phase_offset": 2.9}
    first, second = responses(read := settled(**turned, onboard__drive_phase=AHEAD, onboard__phase_offset=-0.2))
    assert first / (BASE * shown(F0) * cmath.exp(1j * (AHEAD - 0.2))) == pytest.approx(1.0, abs=1e-4)
    closed = SECOND_BASE * shown(SECOND) * cmath.exp(1j * (0.7 + 2.9))
    assert second / closed == pytest.approx(1.0, abs=1e-4)
    assert read["second_phase"].mean() == pytest.approx(-cmath.phase(closed) % (2.0 * math.pi), abs=1e-4)


@pytest.mark.parametrize("second", [SECOND_BASE, 0.0])
def test_notes_of_a_scan_name_both_tones(second):
    values = TWO | TAPS | {"onboard.second_drive_amplitude": second, "onboard.phase_offset": 0.25 if second else 0.0}
    words = notes(build(InstrumentParameters, values))
    told = (f" and {SECOND / 1e3:.6g} kHz, 4 pm", ", phase offset 0.25 rad") if second else ("", "")
    assert words["Drive"] == f"26 kHz, 10 pm{told[0]} (base)"
    assert words["Lock-in"] == f"4 low-passes of 60 µs{told[1]}"


def test_what_a_lock_in_shows_of_the_other_tone_is_what_its_low_passes_let_through():
    short = {"onboard__time_constant": 20e-6, "onboard__filter_order": 1}
    both = settled(**short)
    one = settled(**short, onboard__second_drive_amplitude=0.0)
    seen = (both["in_phase"] - one["in_phase"]) - 1j * (both["quadrature"] - one["quadrature"])
    # A cos(w2 t) times 2 exp(-i w1 t): at the difference and at the sum of the two.
    t, difference, total = np.arange(1000) * 20 * STEP, SECOND - F0, SECOND + F0
    columns = np.exp(2j * math.pi * np.outer(t, [difference, -difference, total, -total]))
    parts = np.abs(np.linalg.lstsq(columns, seen, rcond=None)[0])
    other = SECOND_BASE * abs(shown(SECOND))
    assert parts[0] + parts[1] == pytest.approx(other * passed(difference, 20e-6, 1), rel=5e-3)
    assert parts[2] + parts[3] == pytest.approx(other * passed(total, 20e-6, 1), rel=5e-3)
    told = BIMODAL.warnings(build(InstrumentParameters, TWO | {n.replace("__", "."): v for n, v in short.items()}))
    assert "of each tone 0.058 passes the low-passes of the other's lock-in" in told[-1]
    assert BIMODAL.warnings(build(InstrumentParameters, TWO)) == []


def test_without_a_second_tone_no_bit_of_the_motion_is_another_than_with_one_tone():
    touching = {"plant.gap": 0.0, "reference.z_r": 50e-9, "plant.hamaker": 1e-19, "onboard.drive_amplitude": 1e-10}
    touching |= {"plant.dt": 2.5e-7, "detector.channels": "amplitude", "onboard.setpoint_voltage": 5.2}
    _, _, one = record(50, **touching)
    _, _, two = record(50, **touching, **{"onboard.kind": "bimodal"})
    assert np.array_equal(one, two)
    more = {"plant.dt": 5e-8, "detector.sample_period": 1e-6, "onboard.kind": "bimodal"}
    _, _, fine = record(50, **touching | more)
    _, _, driven = record(50, **touching | more, **{"onboard.second_drive_amplitude": 1e-10})
    assert not np.array_equal(fine, driven)


def test_second_tone_alone_on_the_tip_is_that_tone_as_the_only_one():
    one = {"onboard__drive": "tip", "onboard__drive_frequency": SECOND, "onboard__second_drive_amplitude": 0.0}
    first, _ = responses(settled(**one, onboard__drive_amplitude=SECOND_BASE))
    _, second = responses(settled(onboard__drive="tip", onboard__drive_amplitude=0.0))
    assert second == pytest.approx(first, rel=1e-9)


def test_second_tone_goes_on_without_a_jump_where_its_frequency_changes():
    parameters = build(InstrumentParameters, TWO)
    scope = Instrument(parameters, 7)
    drive, T = scope.drive, parameters.detector.sample_period

    def angle(t: float) -> float:
        w = scope._layout.record(scope._block, "regulated")
        return float(w.second_phase + w.second_angular_frequency * (t - w.second_since))

    scope.tick(drive)
    for f in (151e3, 99e3):
        before, at = angle(scope.time), scope.time
        scope.set_onboard(changed(scope.parameters, {"onboard.second_drive_frequency": f}))
        scope.tick(drive)
        turned = angle(at + T) - before - 2.0 * math.pi * f * T
        assert math.remainder(turned, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


AVERAGED = {"plant.kind": "averaged", "plant.dt": 1e-6, "onboard.feedback": "external"}


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"plant.dt": 2e-7}, r"plant.dt = 2e-07 s is not allowed with a drive of 1629\d\d Hz, which it does not"),
        ({"detector.sample_period": 2e-6}, r"of a drive of 1629\d\d Hz: the lock-in needs 4 samples a period; take <="),
        ({"plant.modes": 1}, "plant.modes = 1 is not allowed with onboard.second_drive_frequency = 0, the second"),
        (AVERAGED, "with plant.kind = averaged, which averages over the cycle of one tone"),
        ({"plant.kind": "compliant"}, "not allowed with plant.kind = compliant, whose cantilever cannot be excited"),
        ({"onboard.second_drive_amplitude": -1e-12}, "onboard.second_drive_amplitude = -1e-12 m is not allowed"),
    ],
)
def test_what_cannot_be_resolved_or_excited_is_refused_in_a_sentence(values, told):
    fine = {"onboard.kind": "bimodal", "onboard.drive_amplitude": BASE, "onboard.second_drive_amplitude": SECOND_BASE}
    fine |= {"plant.dt": 5e-8, "detector.sample_period": 1e-6}
    lever = {"plant.kind": "lever", "sample.kind": "flat", "plant.Q": 150.0, "plant.gap": 1e-6}
    lever |= {"plant.f0": F0}
    with pytest.raises(ParameterError, match=told):
        Instrument(build(InstrumentParameters, fine | ({} if "compliant" in values.values() else lever) | values))
