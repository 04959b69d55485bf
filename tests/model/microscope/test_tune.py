"""Claims about Tune: the resonance that it finds is that of the cantilever, with uncertainties that are right."""

import math
from pathlib import Path

import numpy as np
import pytest
from printed.page_run import run_programs
from quick_lever import KNOWN, LAW

from afm_model import ControllerParameters, ParameterError, SimParameters, build, changed
from afm_model.microscope import Local, MoveTo, Tune

DRIVEN = {
    "plant.kind": "lever",
    "plant.gap": 500e-9,
    "plant.dt": 2e-7,
    "plant.control_period": 1e-4,
    "sample.kind": "flat",
    "detector.sample_period": 2e-6,
    "onboard.kind": "dynamic",
    "onboard.setpoint_force": 10e-9,
    "onboard.drive_amplitude": 1e-11,
}
STIFF = {"plant.lever": "ppp_nchr", "plant.dt": 2.5e-8, "detector.sample_period": 5e-7}


def driven(**values: float | str) -> Local:
    changes = {name.replace("__", "."): value for name, value in values.items()}
    return Local(build(SimParameters, DRIVEN | changes), build(ControllerParameters, LAW | KNOWN))


@pytest.mark.parametrize("values", [{}, {"plant.Q": 15.0}, STIFF], ids=["soft", "damped", "stiff"])
def test_resonance_and_quality_factor_are_those_of_the_cantilever_within_a_thousandth(values):
    microscope = driven(**values)
    cantilever = microscope.instrument.parameters.plant.cantilever_numbers
    outcome = microscope.execute(Tune(points=16, average=2e-4, free_amplitude=20e-9))
    assert (outcome.status, outcome.message) == ("complete", "")
    found = outcome.result.attributes
    assert found["f0_Hz"] == pytest.approx(cantilever.f0, rel=1e-5)
    assert found["Q"] == pytest.approx(cantilever.Q, rel=1e-3)
    # A quarter of a period late, but for what the second mode adds: 1 / Q of it, and more of that for a low Q.
    assert found["phase_rad"] == pytest.approx(0.5 * math.pi, abs=0.1 / cantilever.Q)
    # Gamma Q, by the slope of the first mode.
    assert found["amplitude_m"] == pytest.approx(2.0 / 3.0 * 1.3765 * 1.5660 * cantilever.Q * 1e-11, rel=1e-3)
    # What the drive is set to gives what was asked for: a move takes many decay times.
    microscope.execute(MoveTo(x=1e-9))
    state = microscope.instrument.orders.onboard
    assert state.amplitude * 10e-9 == pytest.approx(20e-9, rel=1e-3)
    assert state.phase == pytest.approx(0.5 * math.pi, abs=5e-5 * cantilever.Q)  # 2e-5 of f0 there


def settled(microscope: Local) -> float:
    """Phase [rad] after many decay times."""
    microscope.execute(MoveTo(x=0.0 if microscope.state.place[0] else 1e-9))
    return float(microscope.instrument.orders.onboard.phase)


def test_free_cantilever_shows_a_quarter_of_a_turn_at_resonance_however_late_its_signal_is():
    late = math.atan(26e3 / 60e3)  # of a low-pass of the photodiode
    microscope = driven(plant__Q=15.0, plant__f0=26e3, detector__bandwidth=60e3, detector__sample_period=1e-6)
    verb = Tune(points=16, average=2e-4, free_amplitude=20e-9)
    first = microscope.execute(verb).result.attributes
    assert first["phase_rad"] == pytest.approx(0.5 * math.pi + late, abs=0.1 / 15.0)
    assert first["phase_offset_rad"] == pytest.approx(first["phase_rad"] - 0.5 * math.pi, abs=1e-15)
    assert microscope.instrument.parameters.onboard.phase_offset == first["phase_offset_rad"]
    assert settled(microscope) == pytest.approx(0.5 * math.pi, abs=1e-3)
    # Below the resonance it is (38) of the mode, counted from there, and the filter a little less late.
    view = microscope.instrument
    view.set_onboard(changed(view.parameters, {"onboard.drive_frequency": 0.98 * 26e3}))
    own = math.atan2(0.98 / 15.0, 1.0 - 0.98**2) + math.atan(0.98 * 26 / 60) - late
    assert settled(microscope) == pytest.approx(own, abs=5e-3)
    # Once more: what the lock-in shows is right already.
    again = microscope.execute(verb).result.attributes
    assert again["phase_rad"] == pytest.approx(0.5 * math.pi, abs=1e-6)
    assert again["phase_offset_rad"] == pytest.approx(first["phase_offset_rad"], abs=1e-6)
    # Without a free amplitude it is told, and nothing is set.
    alone = driven(plant__Q=15.0, onboard__phase_offset=0.4)
    told = alone.execute(Tune(points=16, average=2e-4)).result.attributes
    assert told["phase_rad"] == pytest.approx(0.5 * math.pi - 0.4, abs=0.1 / 15.0)
    assert alone.instrument.parameters.onboard.phase_offset == 0.4


def test_second_resonance_by_the_base_shows_a_quarter_of_a_turn_too():
    microscope = driven(plant__Q=60.0, plant__dt=5e-8, detector__sample_period=1e-6)
    second = 6.2669 * microscope.instrument.parameters.plant.cantilever_numbers.f0
    verb = Tune(points=16, average=2e-4, frequency=second, span=8.0 * second / 60.0, free_amplitude=2e-9)
    found = microscope.execute(verb).result.attributes
    # Forces of inertia are the other way round there (38).
    assert abs(found["phase_offset_rad"]) == pytest.approx(math.pi, abs=1.0 / 60.0)
    assert settled(microscope) == pytest.approx(0.5 * math.pi, abs=2e-3)


def test_uncertainties_cover_under_thermal_noise():
    off = []
    for seed in range(6):
        microscope = driven(plant__temperature=295.0, plant__dt=4e-7, plant__seed=seed)
        found = microscope.execute(Tune(points=16, average=5e-3)).result.attributes
        cantilever = microscope.instrument.parameters.plant.cantilever_numbers
        for name, truth in (("f0_Hz", cantilever.f0), ("Q", cantilever.Q)):
            off.append((found[name] - truth) / found[f"{name}_uncertainty"])
        # Noise matters: the scheme itself is off by 0.07 % of Q.
        assert found["Q_uncertainty"] > 0.01 * cantilever.Q
    assert np.abs(off).max() < 3.5
    # Of 12 numbers the rms is within 0.5 and 1.55 with 99 %.
    assert 0.5 < math.sqrt(np.mean(np.square(off))) < 1.55


@pytest.mark.parametrize(
    ("values", "verb", "told"),
    [
        ({"onboard.kind": "pi"}, Tune(), "onboard.kind = pi, which drives no cantilever: take dynamic"),
        ({"onboard.harmonic": 2}, Tune(), "Tune is not allowed with onboard.harmonic = 2: it must be 1"),
        (
            {"onboard.drive_amplitude": 0.0},
            Tune(),
            "drive_amplitude = 0 m is not allowed where onboard.drive_amplitude",
        ),
        ({}, Tune(frequency=1e4, span=3e4), "span = 30000 Hz is not allowed: it must be > 0 and < 20000 Hz"),
        ({}, Tune(frequency=60e3), "plant.dt = 2e-07 s is not allowed with a drive of 66000 Hz, which it does not"),
        ({}, Tune(frequency=20e3, span=5e3), ""),
    ],
)
def test_what_cannot_be_swept_is_refused_in_a_sentence(values, verb, told):
    unset = {"onboard.drive_amplitude"} if values.get("onboard.kind") == "pi" else set()
    given = {name: value for name, value in (DRIVEN | values).items() if name not in unset}
    microscope = Local(build(SimParameters, given), build(ControllerParameters, LAW | KNOWN))
    sentence = microscope.objection(verb)
    assert told in sentence
    assert bool(told) == bool(sentence)


def test_a_sweep_that_is_broken_off_puts_the_drive_back():
    microscope = driven(onboard__drive_frequency=25e3)
    microscope.operator.begin(Tune(points=16, drive_amplitude=3e-11, free_amplitude=1e-8))
    microscope.step()
    part = microscope.instrument.parameters.onboard
    assert (part.drive_frequency < 25e3, part.drive_amplitude) == (True, 3e-11)
    microscope.operator.cancel()
    while microscope.operator.busy:
        microscope.step()
    outcome, part = microscope.operator.outcome(), microscope.instrument.parameters.onboard
    assert (outcome.status, outcome.result) == ("cancelled", None)
    assert (part.drive_frequency, part.drive_amplitude) == (25e3, 1e-11)


def test_sweep_without_the_resonance_fails_in_words():
    microscope = driven()
    outcome = microscope.execute(Tune(points=16, frequency=20e3, span=4e3, average=2e-4))
    assert outcome.status == "failed"
    assert "no resonance comes out of the sweep: no resonance found from 18000 to 22000 Hz" in outcome.message


def test_example_of_the_page_prints_what_the_page_says(tmp_path):
    page = (Path(__file__).parents[3] / "docs" / "dynamic.md").read_text()
    assert run_programs("docs/dynamic.md", tmp_path, "tune").printed["tune"].strip() in page


@pytest.mark.filterwarnings("ignore:plant.kind = averaged did not hold")
def test_example_of_the_page_of_tapping_prints_what_the_page_says(tmp_path):
    page = (Path(__file__).parents[3] / "docs" / "tapping.md").read_text()
    done = run_programs("docs/tapping.md", tmp_path)
    first, second = done.printed["tapping"].splitlines()
    assert f"    {first}\n    {second}\n" in page
    assert first.startswith("f0 = 77000.0 Hz, Q = 165.0")
    # Of an elastic contact the sine is amplitude over free amplitude, but for the motion of the base.
    assert float(done.scope["image"].phase.median()) == pytest.approx(math.asin(0.7), abs=math.radians(1.0))


def test_plant_without_a_base_refuses_the_drive():
    with pytest.raises(ParameterError, match="whose cantilever cannot be excited"):
        Local(
            build(SimParameters, {"plant.kind": "compliant", "onboard.kind": "dynamic", "plant.gap": 1e-7}),
            build(ControllerParameters, LAW | KNOWN),
        )
