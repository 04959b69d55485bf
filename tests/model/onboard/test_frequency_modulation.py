"""Claims about the loops of frequency and amplitude: the shift is Giessibl's integral, the drive tells what is lost."""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from afm_model import Instrument, ParameterError, build
from afm_model.analysis import beam_energy, energy_from_drive
from afm_model.parameters import InstrumentParameters

from ..analysis.test_tapping import roots

F0, Q, K_LEVER, MODE, SHOWN = 77e3, 60.0, 2.8, 1.0302, 2.0 / 3.0 * 1.3765
CHANNELS = "in_phase, quadrature, frequency_shift, drive_amplitude, truth/indentation, truth/lost_by_viscosity"
LOOPS = {"onboard.phase_bandwidth": 1000.0, "onboard.amplitude_bandwidth": 1000.0}
LAST = 50
"""Periods at the end that are looked at."""


def swung(gap: float, A: float, ticks: int = 500, steps: int = 128, **more: Any) -> tuple[dict[str, Any], Any, Any]:
    """Channels of a cantilever whose end swings with amplitude A, over the last periods, the undeflected tip so far
    from the sample; its parameters; channels from the start.
    """
    dt = 1.0 / (F0 * steps)
    values: dict[str, Any] = {"plant.kind": "lever", "plant.lever": "ppp_fmr", "plant.f0": F0, "plant.Q": Q}
    values |= {"plant.modes": 1, "plant.tilt": 0.0, "plant.dt": dt, "plant.contact": "dmt", "plant.gap": gap}
    values |= {"plant.control_period": steps * dt, "plant.scanner": "stack_13um", "sample.kind": "flat"}
    values |= {"detector.sample_period": dt, "detector.channels": CHANNELS, "onboard.kind": "frequency_modulation"}
    values |= {"onboard.feedback": "external", "onboard.time_constant": 10e-6}
    values |= {"onboard.drive_amplitude": A / (1.5660 * Q), "onboard.amplitude_setpoint": A * SHOWN, **LOOPS}
    parameters = build(InstrumentParameters, values | {name.replace("__", "."): each for name, each in more.items()})
    scope = Instrument(parameters, ticks)
    for _ in range(ticks):
        scope.tick(scope.drive)
    samples = scope.take_block().samples
    read = {each.name: each.scale(parameters) * row for each, row in zip(scope.channels, samples, strict=True)}
    return {name: row[-LAST * steps - 1 :] for name, row in read.items()}, parameters, read


@cache
def free(A: float, **more: Any) -> tuple[float, float]:
    """Frequency shift and drive far from the sample."""
    read, _, _ = swung(1e-6 + A, A, **more)
    return read["frequency_shift"].mean(), read["drive_amplitude"].mean()


def giessibl(force: Callable[[Any], Any], nearest: float, A: float, k: float = K_LEVER) -> float:
    """-f0 / (pi k A) times the integral of F cos from 0 to pi, by the rule of the midpoint."""
    angle = (np.arange(1_000_000) + 0.5) * math.pi / 1_000_000
    return float(-F0 / (MODE * k * A) * np.mean(force(nearest + A + A * np.cos(angle)) * np.cos(angle)))


def in_a_cycle(total: Any, indentation: Any, steps: float) -> float:
    """What a total grows by in a cycle of so many steps: from one highest place of the tip to another."""
    some = round(steps)
    begin = int(np.argmin(indentation[:some]))
    end = indentation.size - some + int(np.argmin(indentation[-some:]))
    return float(total[end] - total[begin]) / round((end - begin) / steps)


def dmt(parameters: Any) -> tuple[Callable[[Any], Any], float]:
    """Force over distance, van der Waals and from where it is the pull-off force on a Hertz contact; that distance."""
    pair, R = parameters.plant.pair_numbers, parameters.plant.cantilever_numbers.tip_radius
    D_0 = math.sqrt(pair.hamaker / (12.0 * math.pi * pair.work_of_adhesion))

    def force(D: Any) -> Any:
        pressed = pair.K * math.sqrt(R) * np.maximum(D_0 - D, 0.0) ** 1.5
        return pressed - pair.hamaker * R / 6.0 / np.maximum(D, D_0) ** 2

    return force, D_0


@pytest.mark.parametrize(
    ("A", "gap"),
    [
        (1e-9, 3e-9),
        (10e-9, 12e-9),
        pytest.param(0.1e-9, 3.1e-9, marks=pytest.mark.long),
        pytest.param(0.3e-9, 3e-9, marks=pytest.mark.long),
        pytest.param(3e-9, 5e-9, marks=pytest.mark.long),
        pytest.param(30e-9, 32e-9, marks=pytest.mark.long),
        pytest.param(50e-9, 52e-9, marks=pytest.mark.long),
    ],
)
def test_shift_by_van_der_waals_is_the_integral_of_giessibl(A, gap):
    read, parameters, _ = swung(gap, A)
    force, D_0 = dmt(parameters)
    nearest = D_0 - read["truth/indentation"].max()
    assert nearest > D_0
    found = read["frequency_shift"].mean() - free(A)[0]
    assert found == pytest.approx(giessibl(force, nearest, A), rel=5e-3, abs=0.0)
    # It is held: nothing is lost, and the amplitude is that of the setpoint.
    assert np.hypot(read["in_phase"], read["quadrature"]).mean() == pytest.approx(A * SHOWN, rel=1e-4)
    assert read["drive_amplitude"].mean() == pytest.approx(free(A)[1], rel=2e-3)


SOFT = {"plant__K": 1e8, "plant__work_of_adhesion": 3e-3, "plant__hamaker": 1e-20, "plant__tau": 1e-3}
"""A sample that is touched for so long that no higher mode rings."""
STIFF = SOFT | {"plant__work_of_adhesion": 1e-3, "plant__k": 40.0}
"""A cantilever whose frequency such a sample changes little, however small its amplitude is."""


@pytest.mark.parametrize(
    ("A", "gap", "more"),
    [
        (0.1e-9, 0.07e-9, STIFF),
        (10e-9, 9.3e-9, SOFT),
        pytest.param(0.1e-9, 0.02e-9, STIFF, marks=pytest.mark.long),
        pytest.param(0.3e-9, 0.1e-9, STIFF, marks=pytest.mark.long),
        pytest.param(1e-9, 0.5e-9, STIFF, marks=pytest.mark.long),
        pytest.param(3e-9, 2.3e-9, SOFT, marks=pytest.mark.long),
        pytest.param(10e-9, 8.5e-9, SOFT, marks=pytest.mark.long),
        pytest.param(30e-9, 29.3e-9, SOFT, marks=pytest.mark.long),
        pytest.param(50e-9, 49.3e-9, SOFT, marks=pytest.mark.long),
    ],
)
def test_shift_by_a_contact_is_the_integral_of_giessibl(A, gap, more):
    more = {"steps": 256, "plant__modes": 2} | more
    read, parameters, _ = swung(gap, A, **more)
    force, D_0 = dmt(parameters)
    shift, drive = free(A, **more)
    nearest = D_0 - read["truth/indentation"].max()
    assert nearest < D_0 - 0.02e-9
    expected = giessibl(force, nearest, A, more.get("plant__k", K_LEVER))
    assert read["frequency_shift"].mean() - shift == pytest.approx(expected, rel=5e-3, abs=0.0)
    assert read["drive_amplitude"].mean() == pytest.approx(drive, rel=1e-3)


@pytest.mark.parametrize(
    ("A", "gap", "viscosity", "more"),
    [
        (10e-9, 9.3e-9, 300.0, SOFT),
        pytest.param(0.1e-9, 0.02e-9, 3e3, STIFF, marks=pytest.mark.long),
        pytest.param(0.3e-9, 0.1e-9, 3e3, STIFF, marks=pytest.mark.long),
        pytest.param(1e-9, 0.5e-9, 300.0, SOFT, marks=pytest.mark.long),
        pytest.param(3e-9, 2e-9, 300.0, SOFT, marks=pytest.mark.long),
        pytest.param(10e-9, 8.5e-9, 300.0, SOFT, marks=pytest.mark.long),
        pytest.param(50e-9, 48e-9, 300.0, SOFT, marks=pytest.mark.long),
    ],
)
def test_drive_that_keeps_the_amplitude_tells_what_the_contact_takes_by_its_account(A, gap, viscosity, more):
    steps, k = 256, more.get("plant__k", K_LEVER)
    more = {"steps": steps, "plant__modes": 2} | more
    read, _, _ = swung(gap, A, plant__viscosity=viscosity, **more)
    shift, drive = free(A, **more)
    f, base = F0 + read["frequency_shift"].mean(), read["drive_amplitude"].mean()
    lost = in_a_cycle(read["truth/lost_by_viscosity"], read["truth/indentation"], steps * F0 / f)
    # Up to a percent goes into the air by harmonics.
    by_drive = energy_from_drive(base / drive, f - F0 - shift, A * SHOWN, f0=F0, Q=Q, k=k, modes=2)
    assert by_drive == pytest.approx(lost, rel=1e-2, abs=0.0)
    # All modes, and harmonics.
    angle = 2.0 * math.pi * f / (F0 * steps) * np.arange(read["deflection"].size)
    waves = [each(n * angle) for n in range(14) for each in (np.cos, np.sin) if n or each is np.cos]
    parts = np.linalg.lstsq(np.column_stack(waves), read["deflection"], rcond=None)[0][1:].reshape(-1, 2)
    more_often = {n: float(np.hypot(*parts[n - 1])) for n in range(2, 14)}
    x, kappa, gain = roots(2)
    r = f / F0 * (x[0] / x) ** 2
    off = base * np.sum(2.0 / 3.0 * kappa * gain * r**2 / (1.0 - r**2 + 1j * r / Q))
    response = complex(read["in_phase"].mean(), -read["quadrature"].mean())
    energy = beam_energy(response, off, frequency=f, f0=F0, Q=Q, k=k, modes=2, harmonics=more_often)
    assert energy.dissipated == pytest.approx(lost, rel=5e-3, abs=0.0)


def test_without_bandwidth_it_is_dynamic_to_the_last_bit():
    off = {"onboard.phase_bandwidth": 0.0, "onboard.amplitude_bandwidth": 0.0, "onboard.amplitude_setpoint": 0.0}
    channels = "in_phase, quadrature, truth/indentation"
    values = {name.replace(".", "__"): each for name, each in off.items()} | {"detector__channels": channels}
    _, _, found = swung(12e-9, 10e-9, ticks=60, **values)
    values = {name: each for name, each in values.items() if not name.startswith("onboard")}
    expected = plain_dynamic(values)
    assert {name: row.tobytes() for name, row in found.items()} == expected


def plain_dynamic(values: dict[str, Any]) -> dict[str, bytes]:
    """The same with onboard.kind dynamic."""
    dt = 1.0 / (F0 * 128)
    given: dict[str, Any] = {"plant.kind": "lever", "plant.lever": "ppp_fmr", "plant.f0": F0, "plant.Q": Q}
    given |= {"plant.modes": 1, "plant.tilt": 0.0, "plant.dt": dt, "plant.contact": "dmt", "plant.gap": 12e-9}
    given |= {"plant.control_period": 128 * dt, "plant.scanner": "stack_13um", "sample.kind": "flat"}
    given |= {"detector.sample_period": dt, "onboard.kind": "dynamic", "onboard.feedback": "external"}
    given |= {"onboard.time_constant": 10e-6, "onboard.drive_amplitude": 10e-9 / (1.5660 * Q)}
    given |= {name.replace("__", "."): each for name, each in values.items()}
    parameters = build(InstrumentParameters, given)
    scope = Instrument(parameters, 60)
    for _ in range(60):
        scope.tick(scope.drive)
    samples = scope.take_block().samples
    pairs = zip(scope.channels, samples, strict=True)
    return {each.name: (each.scale(parameters) * row).tobytes() for each, row in pairs}


def test_frequency_goes_to_the_phase_that_is_asked_for_with_the_bandwidth_that_is_stated():
    """The free cantilever: tan of the lag is (r / Q) / (1 - r^2); a step of z by the sample's force is none here."""
    lag = 1.2
    read, _, whole = swung(1e-6, 10e-9, onboard__phase_setpoint=lag, onboard__phase_bandwidth=300.0)
    r = (math.sqrt(1.0 + 4.0 * (Q * math.tan(lag)) ** 2) - 1.0) / (2.0 * Q * math.tan(lag))
    # With the other terms of the sum (42) the lag of what is shown is less by 1e-5.
    assert read["frequency_shift"].mean() == pytest.approx(F0 * (r - 1.0), rel=2e-3)
    # With a crossover at 300 Hz what is left decays by e in 0.53 ms.
    left = whole["frequency_shift"].reshape(-1, 128).mean(1) - read["frequency_shift"].mean()
    early, late = 150, 230
    rate = math.log(abs(left[early] / left[late])) / (late - early) * F0
    assert rate == pytest.approx(2.0 * math.pi * 300.0, rel=0.15)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"onboard.phase_bandwidth": 2500.0}, r"after which the loop would oscillate: take <= 1.99e\+03 Hz"),
        ({"onboard.amplitude_setpoint": 0.0}, "amplitude_bandwidth is not allowed without onboard.amplitude_setpoint"),
        ({"plant.kind": "compliant"}, "frequency_modulation is not allowed with plant.kind = compliant: take lever"),
    ],
)
def test_what_cannot_be_held_is_refused_in_a_sentence(values, told):
    fine = {"onboard.kind": "frequency_modulation", "onboard.drive_amplitude": 1e-10, "plant.dt": 1e-7}
    fine |= {"detector.sample_period": 1e-6, "onboard.time_constant": 10e-6, "onboard.amplitude_setpoint": 1e-8}
    lever = {"plant.kind": "lever", "sample.kind": "flat"} if "plant.kind" not in values else {}
    with pytest.raises(ParameterError, match=told):
        Instrument(build(InstrumentParameters, fine | LOOPS | lever | values))
