"""Verbs of a run: the bytes of verbs in process, simulated time stands still between them, and every end is told."""

from contextlib import closing

import numpy as np
import pytest
from quick_lever import INSTRUMENT, LAW

from afm_model import Controller, SimParameters, VerbError, build
from afm_model.microscope.local import Local
from afm_model.microscope.operator import Operator
from afm_model.microscope.prepare import with_verbs
from afm_model.microscope.results import CANCELLED, COMPLETE, FAILED, Outcome
from afm_model.microscope.verb import Verb
from afm_model.microscope.verbs import Approach, ForceCurve, MoveTo, Scan, Withdraw
from afm_model.run import Listeners, Run, RunState

from .hand import START, HandLink

APPROACH = Approach(rate=10e-6, range=200e-9, settle=2e-3)
SCAN = Scan(size_x=40e-9, size_y=10e-9, pixels=8, lines=2, line_rate=20.0)
NIGHT: tuple[Verb, ...] = (
    APPROACH,
    MoveTo(x=10e-9, y=-5e-9),
    ForceCurve(lift=100e-9, ramp=200e-9, approach_rate=5e-6, retract_rate=5e-6, trigger_force=20e-9),
    SCAN,
    Withdraw(distance=50e-9),
)


WAYS: dict[str, dict[str, object]] = {
    "inside": {},
    "tick by tick": {"safety.force_limit": 1.0},
    "elsewhere": {"law.kind": "external"},
}
"""Where the law is, and how the instrument is ticked."""


class Bench:
    """A run with an operator; drives of a law elsewhere are sent by hand."""

    def __init__(self, **changes: object) -> None:
        given = INSTRUMENT | LAW | changes
        if given["law.kind"] == "external":
            del given["law.period"]
        self.parameters: SimParameters = with_verbs(build(SimParameters, given))  # type: ignore[arg-type]
        self.now, self.rest = START, 0.0
        self.outcomes: list[Outcome] = []
        self.link = HandLink(self)  # type: ignore[arg-type]
        told = Listeners(verb_over=self.outcomes.append)
        self.run = Run(self.parameters, self.link, lambda: self.now, told, operate=Operator)
        self.law: Controller | None = None
        self.run.step()

    def step(self) -> bool:
        if self.law is not None and self.link.published:
            asked, instrument = self.link.published.pop(), self.run.instrument
            time = round(asked * self.parameters.plant.control_period * 1e9) * 1e-9
            voltage = self.law.answer(instrument.measurement, time)
            assert isinstance(voltage, np.ndarray)
            self.link.send_drive(asked, voltage)
        if (deadline := self.run.deadline) is not None:
            self.now = deadline
        return self.run.step()

    def do(self, verb: Verb, steps: int = 100_000) -> Outcome:
        count = len(self.outcomes)
        self.run.begin(verb)
        return self.wait(count, steps)

    def wait(self, count: int, steps: int = 100_000) -> Outcome:
        for _ in range(steps):
            if len(self.outcomes) > count:
                return self.outcomes[-1]
            self.step()
        raise AssertionError(self.run.snapshot())


@pytest.fixture(scope="module")
def night() -> tuple[list[Outcome], str]:
    """The same verbs in process: how they ended, and the trajectory."""
    parameters = build(SimParameters, INSTRUMENT | LAW)
    inside = parameters.controller_inside
    assert inside is not None
    local = Local(parameters, inside, hashed=True)
    return [local.execute(verb) for verb in NIGHT], local.instrument.trajectory_sha256()


def same(image: object, other: object) -> bool:
    a, b = image.data, other.data  # type: ignore[attr-defined]
    return a.keys() == b.keys() and all(np.array_equal(a[key], b[key]) for key in a)


@pytest.mark.parametrize("way", WAYS)
def test_verbs_of_a_run_give_the_bytes_of_verbs_in_process(way: str, night: tuple[list[Outcome], str]) -> None:
    expected, sha = night
    bench = Bench(**WAYS[way])
    if way == "elsewhere":
        inside = build(SimParameters, INSTRUMENT | LAW).controller_inside
        assert inside is not None
        bench.law = Controller(inside)
    done = [bench.do(verb) for verb in NIGHT]
    assert [outcome.status for outcome in done] == [COMPLETE] * len(NIGHT) == [outcome.status for outcome in expected]
    assert bench.run.instrument.trajectory_sha256() == sha
    assert same(done[3].result, expected[3].result)


def test_simulated_time_stands_still_until_a_verb_begins_and_behind_its_end() -> None:
    bench = Bench()
    assert [bench.run.step() for _ in range(5)] == [False] * 5
    assert bench.run.state == RunState.RUNNING
    assert bench.do(APPROACH).status == COMPLETE
    ticks = bench.run.instrument.ticks
    assert ticks > 0
    assert [bench.run.step() for _ in range(5)] == [False] * 5
    assert bench.run.instrument.ticks == ticks


def test_in_real_time_it_goes_on() -> None:
    bench = Bench(**{"run.mode": "realtime"})
    for _ in range(3):
        bench.step()
    ticks = bench.run.instrument.ticks
    assert ticks > 0
    assert bench.do(APPROACH).status == COMPLETE
    before = bench.run.instrument.ticks
    bench.step()
    assert bench.run.instrument.ticks > before > ticks


def test_verb_waits_while_the_run_is_paused_and_steps_are_made_within_a_verb_only() -> None:
    bench = Bench()
    bench.run.pause()
    assert bench.run.step_by(5) == "no verb is being done: simulated time stands still until one is"
    bench.run.begin(APPROACH)
    assert not bench.run.step()
    assert bench.run.step_by(5) == ""
    while bench.run.stepping:
        bench.run.step()
    assert (bench.run.state, bench.run.instrument.ticks) == (RunState.PAUSED, 5)
    bench.run.play()
    assert bench.wait(0).status == COMPLETE


def test_second_verb_is_refused_while_one_is_being_done() -> None:
    bench = Bench()
    bench.run.begin(APPROACH)
    bench.run.step()
    with pytest.raises(VerbError, match="Withdraw is not allowed while Approach is being done"):
        bench.run.begin(Withdraw())
    assert bench.wait(0).status == COMPLETE


def test_cancelled_scan_keeps_its_lines_and_leaves_the_tip_withdrawn() -> None:
    bench = Bench()
    bench.do(APPROACH)
    bench.run.begin(Scan(size_x=40e-9, size_y=10e-9, pixels=8, lines=1000, line_rate=20.0))
    while bench.run.operator.progress.detail != "line 3 of 1000":
        bench.step()
    bench.run.operator.cancel("cancelled")
    outcome = bench.wait(1)
    assert (outcome.status, outcome.message) == (CANCELLED, "Scan was cancelled; the tip is withdrawn")
    assert outcome.result.lines_done >= 2
    assert np.isfinite(outcome.result.data["height", "trace"][:2]).all()
    assert not bench.run.instrument.in_contact
    assert not bench.run.operator.state.near


class InProcess:
    """As `Bench`, of `Local`."""

    def __init__(self, **changes: object) -> None:
        parameters = build(SimParameters, INSTRUMENT | LAW | changes)
        inside = parameters.controller_inside
        assert inside is not None
        self._local = Local(parameters, inside, hashed=True)
        self.run = self._local.engine

    def do(self, verb: Verb) -> Outcome:
        return self._local.execute(verb)


def test_limit_acts_on_verbs_in_process_to_the_last_bit_as_in_a_run() -> None:
    shas = []
    for kind in (Bench, InProcess):
        bench = kind(**{"safety.force_limit": 15e-9})
        bench.do(APPROACH)
        bench.do(NIGHT[2])
        assert bench.run.bring_back() == ""
        bench.do(APPROACH)
        bench.do(Withdraw())
        shas.append(bench.run.instrument.trajectory_sha256())
    assert shas[0] == shas[1]


@pytest.mark.parametrize("kind", [Bench, InProcess])
def test_limit_that_withdraws_the_sample_stops_the_verb_and_resume_gives_the_verbs_back(
    kind: type[Bench] | type[InProcess],
) -> None:
    bench = kind(**{"safety.force_limit": 15e-9})
    bench.do(APPROACH)
    outcome = bench.do(NIGHT[2])
    assert outcome.status == CANCELLED
    assert outcome.message.startswith("ForceCurve was stopped (the normal force is ")
    assert bench.run.state == RunState.WITHDRAWN
    with pytest.raises(VerbError, match="the run is withdrawn: the normal force is"):
        bench.run.begin(APPROACH)
    assert bench.run.bring_back() == ""
    assert (bench.run.state, bench.run.instrument.in_contact) == (RunState.RUNNING, False)
    assert bench.do(Approach(rate=5e-6, range=2e-6, settle=2e-3)).status == COMPLETE


def test_reset_and_the_end_of_the_run_end_a_verb_and_tell_why() -> None:
    bench = Bench(**{"run.duration": 0.12})
    bench.run.begin(APPROACH)
    bench.run.step()
    bench.run.reset()
    assert (bench.outcomes[-1].status, bench.outcomes[-1].message) == (FAILED, "the run was reset")
    assert bench.run.instrument.ticks == 0
    bench.run.step()
    assert bench.do(APPROACH).status == COMPLETE
    outcome = bench.do(Scan(size_x=40e-9, size_y=10e-9, pixels=8, lines=100, line_rate=20.0))
    assert (outcome.status, outcome.message) == (FAILED, "the run is finished")
    assert outcome.result.lines_done >= 1
    with pytest.raises(VerbError, match="the run is finished: call reset first"):
        bench.run.begin(APPROACH)


def test_another_instrument_begins_anew() -> None:
    bench = Bench()
    first = bench.do(APPROACH)
    bench.do(Withdraw())
    sha = bench.run.instrument.trajectory_sha256()
    changed = build(SimParameters, INSTRUMENT | LAW | {"plant.gap": 15e-9})
    bench.run.exchange(with_verbs(changed))
    assert (bench.run.state, bench.run.instrument.ticks) == (RunState.WAITING, 0)
    bench.run.step()
    assert bench.do(APPROACH).status == first.status
    bench.do(Withdraw())
    assert bench.run.instrument.trajectory_sha256() != sha
    assert bench.run.instrument.parameters.plant.gap == 15e-9


def test_microscope_whose_run_has_failed_says_so_and_is_let_go_of() -> None:
    parameters = build(SimParameters, INSTRUMENT | LAW)
    assert parameters.controller_inside is not None
    with closing(Local(parameters, parameters.controller_inside)) as local:
        local.execute(APPROACH)
        local.engine.fail("the motion diverged")
        with pytest.raises(VerbError, match="the run is fault"):
            local.execute(SCAN)
