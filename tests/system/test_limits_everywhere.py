"""A limit of the instrument acts on every road alike: where the timing is the same, to the last bit."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from clusters import cluster_here
from support import session, write_scenario

from afm_model import Controller, Scenario, build, load_scenario, simulate, sweep
from afm_model.run import OVER, Latency, Link, Run, RunState, VirtualClock, simulate_realtime

LIMIT = 4e-8
SIMULATOR = {
    "run.duration": 2e-3,
    "run.retract_time": 1e-4,
    "safety.force_limit": LIMIT,
    "score.start": 0.0,
    # The law is told less and less deflection, and pushes.
    "fault.crash.kind": "drift",
    "fault.crash.signal": "deflection",
    "fault.crash.size": -1e-4,
    "fault.crash.start": 1e-3,
}
LAW = {"law.kind": "tanh", "law.alpha": 1.0}
SENTENCE = f"(safety.force_limit = {LIMIT:g} N): the sample is withdrawn"


def scenario(folder: Path, **changes: object) -> Scenario:
    given = write_scenario(folder / "crash.yaml", afm_sim_node=SIMULATOR | changes, afm_controller_node=LAW)
    return load_scenario(given)


def by_simulate(given: Scenario, folder: Path) -> tuple[str, int]:
    done = simulate(given.sim, given.controller)
    return done.trajectory_sha256, sum(event.state == RunState.WITHDRAWN for event in done.events)


def by_an_object(given: Scenario, folder: Path) -> tuple[str, int]:
    class Law:
        def __init__(self) -> None:
            self._law = Controller(given.controller)

        def answer(self, measurement: Any) -> Any:
            return self._law.answer(measurement)

    done = simulate(given.sim, Law())
    return done.trajectory_sha256, sum(event.state == RunState.WITHDRAWN for event in done.events)


def by_sweep(given: Scenario, folder: Path) -> tuple[str, int]:
    with cluster_here() as scheduler:
        name = "afm_controller_node.law.alpha"
        (row,) = sweep(given, {name: [1.0]}, scheduler=scheduler, fingerprint=True, progress=False).itertuples()
    assert row.error.startswith("the instrument had the drive in "), row.error
    return row.trajectory_sha256, int("it withdrew the sample 1 time," in row.error)


def by_the_law_inside(given: Scenario, folder: Path) -> tuple[str, int]:
    parameters = build(type(given.sim), {**SIMULATOR, **LAW})
    run = Run(parameters, Link(), VirtualClock())
    while run.state not in OVER:
        run.step()
    return run.instrument.trajectory_sha256(), run.snapshot().counts.withdrawals


def _by_session(given: Scenario, folder: Path, *options: str) -> tuple[str, int]:
    with session(given.path, folder / "out", *options, folder=folder) as command:
        assert command.wait() == 0, command.told()
    card = json.loads((folder / "out" / "scorecard.json").read_text())
    assert not card["valid"]
    return card["trajectory_sha256"], card["withdrawals"]


def in_one_process(given: Scenario, folder: Path) -> tuple[str, int]:
    return _by_session(given, folder, "--composed")


def over_topics(given: Scenario, folder: Path) -> tuple[str, int]:
    return _by_session(given, folder)


@pytest.mark.parametrize("road", [by_simulate, by_an_object, by_sweep, by_the_law_inside, in_one_process, over_topics])
def test_force_limit_withdraws_the_sample_to_the_last_bit_as_in_simulate(
    road: Callable[[Scenario, Path], tuple[str, int]], tmp_path: Path
) -> None:
    given = scenario(tmp_path)
    reference = simulate(given.sim, given.controller)
    assert road(given, tmp_path) == (reference.trajectory_sha256, 1)


def test_simulate_tells_when_the_limit_acted_and_keeps_the_force_small(tmp_path: Path) -> None:
    done = simulate((given := scenario(tmp_path)).sim, given.controller)
    free = simulate((other := scenario(tmp_path, **{"safety.force_limit": 0.0})).sim, other.controller)
    ((time, state, sentence),) = done.events
    assert (state, sentence.endswith(SENTENCE)) == (RunState.WITHDRAWN, True)
    assert 1e-3 < time < 1.6e-3
    (doubt,) = done.doubts
    assert doubt.startswith("the instrument had the drive in ") and doubt.endswith(f"first at {time:.6g} s: {sentence}")
    assert (free.events, free.doubts) == ([], [])
    assert done.truth["contact"][-1] == 0.0 != free.truth["contact"][-1]
    assert max(done.truth["normal_force"]) < 0.5 * max(free.truth["normal_force"])
    before = math.floor(time / given.sim.plant.control_period)
    assert (done.truth["position"][:before] == free.truth["position"][:before]).all()


def test_force_limit_withdraws_the_sample_in_real_time(tmp_path: Path) -> None:
    given = scenario(tmp_path, **{"run.real_time_factor": 5e-3})
    late = simulate_realtime(given.sim, Controller(given.controller), build(Latency, {"median": 3e-4, "spread": 0.0}))
    assert (late.snapshot.state, late.snapshot.counts.withdrawals) == (RunState.FINISHED, 1)
    assert (late.snapshot.reason, late.snapshot.in_contact) == ("force limit", False)
