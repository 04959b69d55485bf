"""Faults to order: what each does, that it does it to the same bit each time, and what is refused."""

import pickle

import numpy as np
import pytest

from afm_model import (
    Controller,
    ControllerParameters,
    Instrument,
    ParameterError,
    SimParameters,
    Simulation,
    build,
    simulate,
)
from afm_model.fault import acted, active, events, faults_of
from afm_model.fault.schedule_entry import KINDS, SENSORS, Entry, problem
from afm_model.parameters.simulator_parameters import SimParameters as Parameters
from afm_model.parts.signals import Measurement

PERIOD = 2e-6
TICKS = 300
BEGIN, END = 100, 150
"""Ticks between which the faults of these tests act."""
PUSH = 0.3
"""By which the drive of x and y grows at each tick where there is no law [V]."""
QUIET = {
    "plant.control_period": PERIOD,
    "run.duration": TICKS * PERIOD,
    "score.start": 0.0,
}
SIZES = {"noise": 1e-11, "offset": 1e-10, "drift": 1e-6, "saturation": 1e-11}


def fault(name: str = "one", **fields: object) -> dict[str, object]:
    """A fault from BEGIN to END, as parameters."""
    given = {"start": BEGIN * PERIOD, "duration": (END - BEGIN) * PERIOD} | fields
    return {f"fault.{name}.{field}": value for field, value in given.items()}


def parameters(*faults: dict[str, object]) -> SimParameters:
    values: dict[str, object] = dict(QUIET)
    for each in faults:
        values |= each
    return build(SimParameters, values)  # type: ignore[arg-type]


LAW = build(ControllerParameters, {})
ALL = [
    fault("a", kind="noise", signal="deflection", size=1e-11, seed=3),
    fault("b", kind="stuck", signal="position_y"),
    fault("c", kind="drift", signal="drive_x", size=10.0),
    fault("d", kind="jitter", signal="measurement", size=3 * PERIOD, seed=4),
    fault("e", kind="loss", signal="measurement", size=0.2, seed=5),
    fault("f", kind="latency", signal="drive", size=2 * PERIOD),
    fault("g", kind="loss", signal="drive", size=0.2, seed=6),
    fault("h", kind="friction", size=1.1),
    fault("i", kind="thermal", signal="z", size=1e-6),
    fault("j", kind="noise", signal="drive_y", size=1e-3, seed=7, duration=-1.0),
]
"""Something of everything at once."""


@pytest.fixture(scope="module")
def quiet() -> Simulation:
    """The same run without a fault."""
    return simulate(parameters(), LAW)


class Asked:
    """A law of ours as an object, which is called in Python and notes what it is asked."""

    def __init__(self) -> None:
        self._law = Controller(LAW)
        self.measurements: list[np.ndarray] = []

    def answer(self, measurement: np.ndarray) -> np.ndarray:
        self.measurements.append(measurement.copy())
        return self._law.answer(measurement)


def changed(a: np.ndarray, b: np.ndarray) -> list[int]:
    """Ticks at which two records of a run differ."""
    return [int(k) for k in np.flatnonzero((a != b).reshape(len(a), -1).any(axis=1))]


def shown(run: Simulation, signal: str) -> np.ndarray:
    """What a sensor told, (ticks,)."""
    name, _, axis = signal.partition("_")
    if axis in ("x", "y", "z"):
        return run.measurements[name][:, "xyz".index(axis)]
    return run.measurements[signal]


# What each kind does.


@pytest.mark.parametrize("signal", SENSORS)
def test_a_sensor_reads_zero_for_as_long_as_it_drops_out_and_no_longer(signal: str) -> None:
    plain, run = (simulate(parameters(*given), Push()) for given in ([], [fault(kind="dropout", signal=signal)]))
    told, otherwise = shown(run, signal), shown(plain, signal)
    assert changed(told, otherwise) == [k for k in range(BEGIN, END) if otherwise[k] != 0.0]
    assert changed(told, otherwise)
    assert not told[BEGIN:END].any()
    # Whoever does not look at it is not moved by it.
    assert run.trajectory_sha256 == plain.trajectory_sha256


class Push:
    """A law that knows nothing: it pushes harder and harder, and overcomes friction before the faults begin."""

    def __init__(self, push: float = PUSH) -> None:
        self.push, self.count = push, 0

    def answer(self, measurement: np.ndarray) -> np.ndarray:
        self.count += 1
        if self.count == 1:
            self.start = measurement.view(Measurement)[0].drive.copy()
        drive = self.start.copy()
        drive[:2] = self.push * self.count
        return drive


@pytest.mark.parametrize("kind", ["noise", "stuck", "offset", "drift", "saturation"])
def test_a_sensor_is_spoiled_as_its_kind_says(kind: str) -> None:
    size = SIZES.get(kind, 0.0)
    run = simulate(parameters(fault(kind=kind, signal="position_x", size=size)), Push())
    true, told = run.truth.position[:, 0], shown(run, "position_x")
    inside = slice(BEGIN, END)
    time = (np.arange(BEGIN, END) - BEGIN) * PERIOD
    expected = {
        "stuck": np.full(END - BEGIN, true[BEGIN]),
        "offset": true[inside] + size,
        "drift": true[inside] + size * time,
        "saturation": np.clip(true[inside], -size, size),
    }
    if kind == "noise":
        error = told[inside] - true[inside]
        assert 0.5 * size < error.std() < 1.5 * size
        assert len(np.unique(error)) == END - BEGIN
    else:
        np.testing.assert_allclose(told[inside], expected[kind], rtol=1e-12, atol=0.0)
        assert (told[inside] != true[inside]).any()
    np.testing.assert_array_equal(np.delete(told, np.s_[inside]), np.delete(true, np.s_[inside]))


def test_the_voltage_of_the_photodetector_tells_what_its_deflection_tells() -> None:
    run = simulate(parameters(fault(kind="offset", signal="deflection", size=1e-9)), Push())
    sensitivity = run.parameters.detector.deflection_sensitivity
    np.testing.assert_allclose(run.measurements["deflection_voltage"] * sensitivity, run.deflection, rtol=1e-12)


def test_a_spoiled_drive_is_the_one_that_is_put_in_force_and_recorded() -> None:
    plain, run = (
        simulate(parameters(*given), Push()) for given in ([], [fault(kind="offset", signal="drive_x", size=0.5)])
    )
    added = run.drive[:, 0] - plain.drive[:, 0]
    assert added[BEGIN:END] == pytest.approx(0.5)
    assert not added[:BEGIN].any()
    assert not added[END:].any()


def test_a_spoiled_drive_is_clipped_as_any_other() -> None:
    run = simulate(
        parameters(fault(kind="offset", signal="drive_x", size=1e6), {"piezo.limit": 40.0, "run.duration": 4e-4}),
        Push(),
    )
    assert run.drive[BEGIN:END, 0].tolist() == [40.0] * (END - BEGIN)


@pytest.mark.parametrize("late", [1, 7, 255])
def test_late_sensor_values_are_those_of_so_many_ticks_ago(late: int) -> None:
    run = simulate(parameters(fault(kind="latency", signal="measurement", size=late * PERIOD)), Push())
    told, true = run.position[:, 0], run.truth.position[:, 0]
    # Until the first late message is there, nothing new comes.
    expected = [k if k < BEGIN or k >= END else max(k - late, BEGIN - 1) for k in range(TICKS)]
    np.testing.assert_array_equal(told, true[expected])
    # The reference is that of the tick: it is told, not measured.
    np.testing.assert_array_equal(run.reference, simulate(parameters(), Push()).reference)


def test_late_drives_are_put_in_force_so_many_ticks_later_and_say_which_measurement_they_answer() -> None:
    run = simulate(parameters(fault(kind="latency", signal="drive", size=1.5 * PERIOD)), Push())
    expected = [k if k < BEGIN or k >= END else max(k - 2, BEGIN - 1) for k in range(TICKS)]
    np.testing.assert_allclose(run.drive[:, 0], PUSH * (np.array(expected) + 1.0))
    assert run.measurements["drive_sequence"][1:].tolist() == expected[:-1]
    assert run.measurements["newest_drive_sequence"][1:].tolist() == expected[:-1]


def test_messages_that_overtake_one_another_count_by_their_number() -> None:
    run = simulate(parameters(fault(kind="jitter", signal="drive", size=5 * PERIOD, seed=1)), Push())
    sequence = run.measurements["drive_sequence"][BEGIN + 1 : END + 1]
    assert (np.diff(sequence) >= 0).all()
    ages = np.arange(BEGIN, END) - sequence
    assert (ages.min(), ages.max() > 2, ages.max() <= 6) == (0, True, True)


def test_a_lost_drive_leaves_the_one_before_in_force() -> None:
    run = simulate(parameters(fault(kind="loss", signal="drive", size=0.3, seed=1)), Push())
    held = np.diff(run.drive[:, 0]) == 0.0
    assert 0.1 < held[BEGIN:END].mean() < 0.5
    assert not held[: BEGIN - 1].any()
    assert not held[END:].any()


def test_nobody_is_asked_for_an_answer_to_a_lost_measurement() -> None:
    law = Asked()
    run = simulate(parameters(fault(kind="loss", signal="measurement", size=0.3, seed=1)), law)
    lost = TICKS - len(law.measurements)
    assert 0.1 < lost / (END - BEGIN) < 0.5
    assert (np.diff(run.drive, axis=0) == 0.0).all(axis=1).sum() == lost


def test_friction_is_so_many_times_its_own(quiet: Simulation) -> None:
    run = simulate(parameters(fault(kind="friction", size=1.5)), LAW)
    ratio = run.truth.friction_bound / quiet.truth.friction_bound
    # The bound of a step is known at its end.
    assert ratio[BEGIN + 1 : BEGIN + 3] == pytest.approx(1.5, rel=0.02)
    assert ratio[: BEGIN + 1].tolist() == [1.0] * (BEGIN + 1)
    assert ratio[-1] == pytest.approx(1.0, rel=0.02)


def test_a_sample_that_has_drifted_lifts_the_tip_as_the_scanner_does_and_stays() -> None:
    by = 1e-10
    long = {"run.duration": 0.01}
    drifted = fault(kind="thermal", signal="z", size=1e-6, duration=by / 1e-6)
    lifted = fault(kind="offset", signal="drive_z", size=by / parameters().piezo.sensitivity_z, duration=-1.0)
    plain, sample, scanner = (simulate(parameters(long, *given), Push(push=0.0)) for given in ([], [drifted], [lifted]))
    by_sample, by_scanner = ((run.truth.tip_height - plain.truth.tip_height) for run in (sample, scanner))
    assert not by_sample[: BEGIN + 1].any()
    # Both have settled in the second half; the contact gives way a little.
    half = len(by_sample) // 2
    assert by_sample[half:].mean() == pytest.approx(by_scanner[half:].mean(), rel=0.01)
    assert 0.5 * by < by_sample[half:].mean() < by


def test_a_sample_that_drifts_along_x_is_seen_by_no_sensor_of_the_scanner() -> None:
    run = simulate(parameters(fault(kind="thermal", signal="x", size=1e-6)), Push())
    np.testing.assert_array_equal(run.position, run.truth.position)


# What is told.


def test_begin_and_end_are_told_with_their_ticks() -> None:
    given = parameters(
        fault("burst", kind="noise", signal="deflection", size=1e-11),
        fault("late", kind="dropout", signal="drive_z", start=1.0),
    )
    assert events(given, 0, TICKS) == [
        (BEGIN, "fault burst begins: noise of 1e-11 m on deflection"),
        (END, "fault burst ends"),
    ]
    assert events(given, BEGIN, BEGIN) == []
    assert [active(given, k) for k in (BEGIN - 1, BEGIN, END - 1, END)] == [[], ["burst"], ["burst"], []]
    assert [acted(given, k) for k in (BEGIN, BEGIN + 1, TICKS)] == [[], ["burst"], ["burst"]]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_words(kind: str) -> None:
    assert Entry(kind=kind, signal=KINDS[kind].targets[0], size=0.5).describe().startswith(kind)  # type: ignore[arg-type]


# What is refused.


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"fault.a.start": 1.0}, "fault.a.kind is missing: it must be one of noise, dropout"),
        ({"fault.a.kind": "burst"}, "fault.a.kind = burst is not allowed: it must be one of none, noise"),
        (
            {"fault.a.kind": "noise"},
            "fault.a.signal = none is not allowed for a fault of kind noise: it must be one of",
        ),
        (fault("a", kind="loss", signal="drive_x"), "fault.a.signal = drive_x is not allowed for a fault of kind loss"),
        (fault("a", kind="friction", signal="x", size=1.0), "fault.a.signal = x .* kind friction: it has none"),
        (
            fault("a", kind="stuck", signal="drive_x", size=1.0),
            "fault.a.size = 1 is not allowed: a fault of kind stuck has none",
        ),
        (fault("a", kind="loss", signal="drive", size=1.1), "fault.a.size = 1.1 .* it must be >= 0 and <= 1"),
        (fault("a", kind="latency", signal="drive", size=1.0), "fault.a.size = 1 .* must be >= 0 and <= 0.00051"),
        (fault("a", kind="thermal", signal="z", size=1.0), "fault.a.size = 1 .* it must be >= -1e-06 and <= 1e-06"),
        (fault("a", kind="noise", signal="drive_x", start=-1.0), "fault.a.start = -1.0 s is not allowed"),
        ({"fault.a.knd": "noise"}, "unknown parameter fault.a.knd: did you mean fault.a.kind"),
        ({"fault.A.kind": "noise"}, "fault.A is not allowed: the name must be of small letters"),
        ({"fault.copy.kind": "noise"}, "fault.copy is not allowed"),
        ({"fault.kind": "none", **fault("a", kind="friction")}, "unknown parameter fault.a"),
        (
            {f"fault.a{i}.kind": "friction" for i in range(17)},
            "17 faults at a time are too many: 16 are the most",
        ),
    ],
)
def test_a_fault_that_cannot_be_is_refused_with_one_sentence(values: dict[str, object], sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        parameters(values)


def test_an_instrument_without_a_schedule_takes_no_faults() -> None:
    scope = Instrument(parameters({"fault.kind": "none"}))
    with pytest.raises(ParameterError, match=r"fault.kind = none takes no faults while it runs"):
        scope.set_faults(parameters(*ALL))


def test_parameters_with_faults_can_be_sent_to_another_process() -> None:
    given = parameters(*ALL)
    assert pickle.loads(pickle.dumps(given)) == given
    assert list(faults_of(given)) == list("abcdefghij")
    assert isinstance(given, Parameters)


def test_what_is_not_allowed_is_a_sentence_and_what_is_allowed_none() -> None:
    assert problem("fault.a", Entry(kind="friction", size=2.0), PERIOD) == ""
