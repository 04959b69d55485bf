"""The score of a run over topics is that of the same run without any, field by field."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hand_controller import run_in_process
from support import Graph, Observer, write_scenario

from afm_bringup.session_scorecard import summary_of
from afm_controller_node.node import ControllerNode
from afm_model import Controller, ControllerParameters, Instrument, SimParameters, build
from afm_model.instrument.score import COUNTS, row
from afm_node_common.cdr import BlockEncoder, Codec
from afm_sim_node.node import SimNode

PERIOD = 2e-6


@contextmanager
def two_nodes(folder: Path, law: str, ticks: int, **parameters: object) -> Iterator[tuple[Graph, Observer]]:
    """The project's own simulator and controller, each with its own loop."""
    given = {"run.duration": ticks * PERIOD, "score.start": 0.0, "plant.control_period": PERIOD} | parameters
    file = write_scenario(folder / "nodes.yaml", afm_sim_node=given, afm_controller_node={"law.kind": law})
    with Graph(["--ros-args", "--params-file", str(file)]) as graph:
        observer = graph.add(Observer())
        graph.add(ControllerNode())
        graph.add(SimNode())
        yield graph, observer


def in_process(law: str, ticks: int, **parameters: object) -> Instrument:
    values = {"score.start": 0.0, "plant.control_period": PERIOD} | parameters
    instrument = Instrument(build(SimParameters, values))
    return run_in_process(instrument, Controller(build(ControllerParameters, {"law.kind": law})), ticks)


@pytest.mark.parametrize(
    ("law", "parameters"),
    [
        ("tanh", {}),
        ("sgn", {"plant.kind": "paper", "plant.z": "uniform", "plant.seed": 3}),
        ("open_loop", {"detector.noise": 1e-3, "detector.position_noise": 1e-12, "detector.adc_bits": 16}),
    ],
)
def test_score_over_topics_is_that_of_the_loop_in_process(
    tmp_path: Path, law: str, parameters: dict[str, object]
) -> None:
    ticks = 2000
    expected = in_process(law, ticks, **parameters)
    summary = expected.score()
    with two_nodes(tmp_path, law, ticks, **parameters) as (graph, observer):
        graph.spin_until(lambda: observer.scores)
        score = observer.scores[0]
    assert score.trajectory_sha256 == expected.trajectory_sha256()
    assert (score.ticks, score.start, score.simulated) == (ticks, 0.0, expected.time)
    assert row(summary_of(score)) == row(summary)
    trip = score.round_trip
    assert math.isnan(score.lateness.p50) and math.isnan(score.command_age.max)
    assert 0.0 < trip.p50 <= trip.p99 <= trip.p99_9 <= trip.max <= score.wall


def test_slow_codec_gives_the_same_trajectory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for each in (Codec, BlockEncoder):  # as if the middleware laid messages out in another way
        monkeypatch.setattr(each, "_agrees", lambda _: False)
    with two_nodes(tmp_path, "tanh", 500) as (graph, observer):
        graph.spin_until(lambda: observer.scores)
        assert observer.scores[0].trajectory_sha256 == in_process("tanh", 500).trajectory_sha256()


def test_score_of_a_run_that_ends_before_scoring_is_nan_throughout(tmp_path: Path) -> None:
    with two_nodes(tmp_path, "tanh", 10, **{"score.start": 1.0}) as (graph, observer):
        graph.spin_until(lambda: observer.scores)
        score = observer.scores[0]
    assert (score.ticks, score.stick_phases) == (0, 0)
    assert all(math.isnan(value) for name, value in row(summary_of(score)).items() if name not in COUNTS)


@pytest.mark.parametrize(("period", "told"), [(4e-6, True), (PERIOD, False)])
def test_controller_warns_of_a_law_that_is_made_for_another_period(tmp_path, capfd, period, told) -> None:
    with two_nodes(tmp_path, "observer", 20, **{"plant.control_period": period}) as (graph, observer):
        graph.spin_until(lambda: observer.scores)
    sentence = "the law is made for another rate: law.period = 2e-06 s, and a measurement is taken every 4e-06 s"
    assert (sentence in capfd.readouterr().err) == told
