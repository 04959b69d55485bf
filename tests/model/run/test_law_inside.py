"""A law inside the simulator: the bytes of the same law elsewhere, and every control of a run works with it."""

from pathlib import Path

import pytest

from afm_model import ControllerParameters, ParameterError, SimParameters, build, changed, simulate
from afm_model.parameters.scenario import ScenarioError, load_scenario
from afm_model.run import Listeners, Run, RunState

from .hand import START, Bench

PERIOD = 2e-5
TICKS = 700
LOSSES = {"fault.lost.kind": "loss", "fault.lost.signal": "measurement", "fault.lost.size": 0.2, "fault.lost.seed": 5}
PLANT = {
    "plant.control_period": PERIOD,
    "plant.dt": 1e-6,
    "detector.sample_period": 1e-6,
    "run.duration": TICKS * PERIOD,
    "score.start": 0.0,
}
LAWS: dict[str, dict[str, object]] = {
    "tanh": {"law.kind": "tanh", "law.alpha": 1.0},
    "pid": {"law.kind": "pid", "law.period": PERIOD},
}


def parameters(law: str, **changes: object) -> SimParameters:
    return build(SimParameters, PLANT | LAWS[law] | changes)  # type: ignore[arg-type]


def in_process(law: str, **changes: object) -> str:
    """Trajectory of the law outside, by `simulate`."""
    sim = build(SimParameters, PLANT | changes)  # type: ignore[arg-type]
    return simulate(sim, build(ControllerParameters, LAWS[law])).trajectory_sha256  # type: ignore[arg-type]


class Alone:
    """A simulator with its law inside, by a clock that the test sets."""

    def __init__(self, law: str, **changes: object) -> None:
        self.bench = Bench("lockstep", **(PLANT | LAWS[law] | changes))  # type: ignore[arg-type]
        self.run = self.bench.run

    def to_the_end(self) -> str:
        for _ in range(10 * TICKS):
            if self.run.state in (RunState.FINISHED, RunState.FAULT):
                break
            self.run.step()
        assert self.run.state == RunState.FINISHED, self.run.snapshot()
        return self.run.instrument.trajectory_sha256()


@pytest.mark.parametrize("changes", [{}, LOSSES], ids=["", "with lost measurements"])
@pytest.mark.parametrize("law", LAWS)
def test_trajectory_is_that_of_the_same_law_outside(law: str, changes: dict[str, object]) -> None:
    alone = Alone(law, **changes)
    assert alone.to_the_end() == in_process(law, **changes)
    assert alone.bench.link.published == []
    assert sum(len(block.drives) for block in alone.bench.blocks) == TICKS


def test_trajectory_is_the_same_where_limits_are_looked_at_after_every_tick() -> None:
    assert Alone("pid", **{"safety.force_limit": 1e-3}).to_the_end() == in_process("pid")


def test_limit_withdraws_the_sample_and_resume_brings_it_back() -> None:
    limits = {"safety.travel_limit": 1e-9, "run.retract_time": 5 * PERIOD, "run.duration": 0.0}
    alone = Alone("tanh", **limits, **{"reference.omega_x": 2000.0})
    while alone.run.state != RunState.WITHDRAWN:
        alone.run.step()
    assert alone.run.snapshot().detail.startswith("the scanner is at x = ")
    for _ in range(20):
        alone.run.step()
    assert not alone.run.instrument.in_contact
    assert alone.run.resume() == ""
    assert alone.run.state == RunState.APPROACHING


def test_steps_are_counted_pause_stops_and_reset_begins_the_same_again() -> None:
    alone = Alone("pid", **{"run.start_paused": True})
    run = alone.run
    assert run.step_by(37) == ""
    while run.stepping:
        run.step()
    assert (run.state, run.instrument.ticks) == (RunState.PAUSED, 37)
    assert run.play() == ""
    run.step()
    assert run.pause() == ""
    ticks = run.instrument.ticks
    assert not run.step()
    assert (run.instrument.ticks, ticks > 37) == (ticks, True)
    run.reset()
    run.play()
    assert alone.to_the_end() == in_process("pid")


def test_pieces_of_real_time_begin_at_deadlines_and_missed_periods_are_told() -> None:
    alone = Alone("tanh", **{"run.mode": "realtime", "run.duration": 0.0})
    bench, run = alone.bench, alone.run
    run.step()
    assert run.state == RunState.RUNNING
    assert run.deadline == pytest.approx(START + PERIOD)
    assert not run.step()
    piece = 250  # 5 ms
    bench.now = run.deadline or 0.0
    assert run.step()
    assert (run.instrument.ticks, run.deadline) == (piece, pytest.approx(START + PERIOD + piece * PERIOD))
    # Late by less than a piece: what was missed is made up for by making the next one at once.
    bench.now = (run.deadline or 0.0) + 0.5 * piece * PERIOD
    assert run.step()
    assert run.snapshot().counts.periods_missed == 0
    late = 3 * piece
    bench.now = (run.deadline or 0.0) + late * PERIOD
    before = run.deadline or 0.0
    assert run.step()
    counts = run.snapshot().counts
    assert (counts.late_ticks, abs(counts.periods_missed - late) <= 1) == (1, True)
    made = run.instrument.ticks - 2 * piece
    assert run.deadline == pytest.approx(before + (counts.periods_missed + made) * PERIOD)


def test_trajectory_in_real_time_is_that_of_lockstep() -> None:
    alone = Alone("pid", **{"run.mode": "realtime"})
    while alone.run.state != RunState.FINISHED:
        alone.run.step()
        alone.bench.now = max(alone.bench.now, alone.run.deadline or 0.0)
    assert alone.run.instrument.trajectory_sha256() == in_process("pid")


def test_other_gains_are_in_force_from_the_next_piece_on() -> None:
    alone = Alone("tanh", **{"run.start_paused": True})
    alone.run.step_by(100)
    while alone.run.stepping:
        alone.run.step()
    alone.run.adapt(changed(alone.bench.parameters, {"law.M_x": 0.0}))
    alone.run.play()
    assert alone.to_the_end() != in_process("tanh")


def test_law_that_answers_no_number_ends_the_run_in_a_sentence() -> None:
    alone = Alone("tanh", **{"piezo.limit": 0.0})
    alone.run.step()
    alone.run.step()
    alone.run.instrument.measurement[:] = float("nan")
    alone.run.step()
    assert alone.run.state == RunState.FAULT
    assert "must be a finite number (answer to measurement 1 from law tanh)" in alone.run.snapshot().detail


def test_law_with_a_model_of_friction_is_refused_on_a_plant_that_has_another(tmp_path: Path) -> None:
    path = tmp_path / "lever.yaml"
    path.write_text(
        "/**/afm_sim_node:\n  ros__parameters: {plant.kind: lever, sample.kind: flat, onboard.kind: pi}\n"
        "/**/afm_controller_node:\n  ros__parameters: {law.kind: predictive}\n"
    )
    words = "law.kind = predictive is not allowed with plant.kind = lever: its model of friction is that of"
    with pytest.raises(ScenarioError, match=words):
        load_scenario(path)
    lever = build(SimParameters, PLANT | {"plant.kind": "lever", "sample.kind": "flat", "onboard.kind": "pi"})
    with pytest.raises(ParameterError, match=words):
        simulate(lever, build(ControllerParameters, {"law.kind": "predictive", "law.period": PERIOD}))


def test_scenario_with_the_law_inside_has_its_controller_and_its_timing(tmp_path: Path) -> None:
    path = tmp_path / "alone.yaml"
    section = "/**/afm_sim_node:\n  ros__parameters:\n    plant.control_period: 5.0e-5\n    law.kind: predictive\n"
    path.write_text(section)
    scenario = load_scenario(path)
    assert scenario.controller == load_scenario("closed_loop_predictive").controller
    path.write_text(section + "/**/afm_controller_node:\n  ros__parameters:\n    law.kind: predictive\n")
    with pytest.raises(
        ScenarioError, match=r"law\.kind = predictive of afm_sim_node puts the law inside the simulator"
    ):
        load_scenario(path)


def test_law_inside_believes_of_a_lever_what_its_controller_would(tmp_path: Path) -> None:
    common = "/**:\n  ros__parameters:\n    microscope.setpoint_force: 5.0e-9\n    microscope.control_period: 4.0e-5\n"
    loop = "/**/afm_sim_node:\n  ros__parameters:\n    onboard.kind: pi\n"
    inside, outside = tmp_path / "inside.yaml", tmp_path / "outside.yaml"
    inside.write_text(common + loop + "    law.kind: pid\n")
    outside.write_text(common + loop + "/**/afm_controller_node:\n  ros__parameters:\n    law.kind: pid\n")
    assert load_scenario(inside).controller == load_scenario(outside).controller


def test_law_inside_is_refused_as_it_is_in_a_controller_and_external_is_for_the_simulator_alone() -> None:
    with pytest.raises(ParameterError, match="there is no law nonsense"):
        build(SimParameters, {"law.kind": "nonsense"})
    with pytest.raises(ParameterError, match=r"law.alpha = -1.0 is not allowed"):
        build(SimParameters, {"law.kind": "tanh", "law.alpha": -1.0})
    with pytest.raises(ParameterError, match=r"law\.kind = external is not allowed here: it is for the simulator"):
        build(ControllerParameters, {"law.kind": "external"})
    assert SimParameters().controller_inside is None


def test_piece_that_takes_long_is_followed_by_a_shorter_one() -> None:
    now, lengths = [0.0], []

    def clock() -> float:
        now[0] += 1.0
        return now[0]

    bench = Bench("lockstep")
    told = Listeners(block=lambda block, _: lengths.append(len(block.drives)))
    run = Run(parameters("tanh"), bench.link, clock, told)
    for _ in range(4):
        run.step()
    assert run.instrument.ticks == 3
