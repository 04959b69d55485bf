"""What a law believes, in the recording: the same numbers as in process, whoever runs the law."""

from pathlib import Path

import numpy as np
import pytest
from support import Graph, Observer, write_scenario

from afm_controller_node.node import ControllerNode
from afm_model import Controller, ControllerParameters, Instrument, SimParameters, build
from afm_node_common import topics
from afm_recorder_node.node import RecorderNode
from afm_recorder_node.reader import read_recording
from afm_sim_node.node import SimNode

PERIOD, TICKS, RASTER = 5e-5, 1000, 100
INSTRUMENT = {
    "plant.control_period": PERIOD,
    "plant.delay_ticks": 1,
    "detector.lateral_gain": 1.1,
    "run.duration": TICKS * PERIOD,
    "run.start_paused": True,
}
LAW = {"law.kind": "predictive", "law.period": PERIOD, "law.delay_ticks": 1}


def believed_in_process() -> list[dict[str, float]]:
    """After every tick."""
    plain = {name: value for name, value in INSTRUMENT.items() if name != "run.start_paused"}
    instrument, law = Instrument(build(SimParameters, plain), TICKS), Controller(build(ControllerParameters, LAW))
    told = []
    for tick in range(TICKS):
        instrument.tick(law.answer(instrument.measurement, tick * PERIOD), tick)
        told.append({each.name: each.value for each in law.estimates})
    return told


@pytest.mark.parametrize("inside", [False, True])
def test_estimates_of_a_law_are_channels_of_the_recording(tmp_path: Path, inside: bool) -> None:
    path = tmp_path / "run.mcap"
    scenario = write_scenario(
        tmp_path / "run.yaml",
        afm_sim_node=INSTRUMENT | (LAW if inside else {}),
        afm_controller_node=LAW,
        afm_recorder_node={"path": str(path), "view": False},
    )
    with Graph(["--ros-args", "--params-file", str(scenario)]) as graph:
        observer, recorder, simulator = graph.add(Observer()), graph.add(RecorderNode()), graph.add(SimNode())
        law = simulator if inside else graph.add(ControllerNode())
        graph.spin_until(lambda: observer.recorder.ready and law.estimates.wanted)
        assert observer.call(graph, topics.PLAY).success
        graph.spin_until(lambda: observer.scores and recorder.recorder.present.scored)
        told = believed_in_process()
        streams = recorder.recorder.present.streams
        graph.spin_until(lambda: {f"law/{name}" for name in told[0]} <= set(streams))
        own = [streams[f"law/{name}"] for name in told[0]]
        graph.spin_until(lambda: all(stream.next == TICKS // RASTER for stream in own))
        recorder.finish(lambda timeout: graph.spin())
    recording = read_recording(path)
    for name in told[0]:
        channel = recording.channels[f"law/{name}"]
        np.testing.assert_allclose(channel.time, np.arange(TICKS // RASTER) * RASTER * PERIOD, atol=1e-9)
        for k, value in zip(range(0, TICKS, RASTER), channel.values, strict=True):
            # A law inside is asked where a block ends; the period is known from the second measurement on.
            asked = range(k, TICKS) if inside else [max(k, 1)]
            assert any(told[at][name] == pytest.approx(value, rel=1e-14, abs=0.0) for at in asked), (name, k)
    gain = recording.channels["law/lateral_gain_x"].values
    assert (inside or gain[0] == 1.0) and abs(gain[-1] - 1.0) > 0.02
