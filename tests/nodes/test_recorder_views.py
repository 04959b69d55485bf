"""What the viewer shows of a recording: the friction loop, and an arrangement in which nothing hides anything."""

import os
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb
from recorded import Run
from rerun.chunk import RrdReader

from afm_recorder_node import layout, screens, streams
from afm_recorder_node.complete import chunks
from afm_recorder_node.friction_loop import HEIGHT, POINTS, ROWS, WIDTH, FrictionLoop
from afm_recorder_node.reader import read_recording
from afm_recorder_node.writer import RecordingWriter

PERIOD = 1e-3


def write(path: Path, position: np.ndarray, force: np.ndarray) -> None:
    """A recording of a position along x [m] and a lateral force [N], sampled together."""
    ticks = len(position)
    along = np.zeros((ticks, 3))
    along[:, 0] = position
    with closing(RecordingWriter(path)) as writer:
        for channel in layout.CHANNELS:
            writer.channel(channel, 0, PERIOD, force if channel is layout.LATERAL_FORCE else np.zeros(ticks), 1.0)
        columns = {"position": along, "reference": along, "drive": along}
        writer.control(
            0, PERIOD, **columns, deflection=np.zeros(ticks), round_trip=np.zeros(ticks), cantilever_height=0.0
        )


def drawn(path: Path, entity: str, component: str) -> list[object]:
    found = [c.to_record_batch() for c in chunks(path) if c.entity_path == entity and c.is_static]
    return [batch.column(component).to_pylist()[0] for batch in found]


def test_complete_recording_holds_the_friction_loop_with_its_ends(tmp_path: Path) -> None:
    phase = np.linspace(0.0, 2.0 * np.pi, 400)
    write(tmp_path / "run.rrd", 5e-9 * np.sin(phase), 134e-9 * np.sign(np.cos(phase)))
    ((strip,),) = drawn(tmp_path / "run.rrd", layout.FRICTION_LOOP, "LineStrips2D:strips")
    points = np.array(strip)
    assert points.shape == (400, 2)
    # From edge to edge of its frame; a position to the right is drawn to the right, a force upwards upwards.
    assert points.min(axis=0) == pytest.approx([0.0, 0.0], abs=1e-6)
    assert points.max(axis=0) == pytest.approx([WIDTH, HEIGHT], rel=1e-6)
    assert points[0, 1] == 0.0
    assert points[:, 0] == pytest.approx(WIDTH / 2 * (1.0 + np.sin(phase)), abs=1e-3)
    (labels,) = drawn(tmp_path / "run.rrd", f"{layout.FRICTION_LOOP}/ends", "Points2D:labels")
    assert labels == ["-5 nm", "5 nm", "-134 nN", "134 nN"]
    # The drawing is no channel.
    assert set(read_recording(tmp_path / "run.rrd").channels) == {signal.name for signal in layout.CHANNELS}


def test_recording_without_motion_has_no_friction_loop(tmp_path: Path) -> None:
    write(tmp_path / "run.rrd", np.zeros(100), np.zeros(100))
    assert drawn(tmp_path / "run.rrd", layout.FRICTION_LOOP, "LineStrips2D:strips") == []


def test_friction_loop_of_a_long_run_is_that_of_its_end_and_takes_no_more_memory() -> None:
    loop = FrictionLoop()
    count = ROWS // 4
    for block in range(12):
        times = np.arange(block * count, (block + 1) * count)
        loop.put(layout.POSITION.entity, times, np.column_stack([times, times, times]).astype(float))
        loop.put(layout.LATERAL_FORCE.entity, times, -times[:, np.newaxis].astype(float))
    points = loop.points()
    assert len(points) == POINTS
    assert points[0, 0] == 12 * count - ROWS
    assert points[:, 1] == pytest.approx(-points[:, 0])


def views(part: object) -> list[rrb.View]:
    if isinstance(part, rrb.View):
        return [part]
    return [view for inner in part.contents for view in views(inner)]


def test_no_plot_of_the_arrangement_holds_two_axes_and_every_entity_is_shown() -> None:
    shown = views(screens.blueprint(["/truth/creep_x"]).root_container)
    entities = {entity for view in shown if isinstance(view.contents, list) for entity in view.contents}
    signals = (*layout.TICKS, *layout.CHANNELS)
    assert {signal.entity for signal in signals} | {"/truth/creep_x"} <= entities
    assert {layout.RUN, layout.EVENTS, layout.PARAMETERS, layout.FRICTION_LOOP, layout.SCENE} <= {
        view.origin for view in shown
    }
    for signal in signals:
        plots = [view for view in shown if isinstance(view.contents, list) and signal.entity in view.contents]
        lines = [view.visualizer_overrides[signal.entity].overrides for view in plots if view.visualizer_overrides]
        seen = [values.as_arrow_array().to_pylist() for (values,) in lines]
        # Three numbers are three plots with one of them each.
        assert (len(plots), seen) == ((3, np.eye(3, dtype=bool).tolist()) if signal.width == 3 else (1, []))
        assert all(view.properties["PlotLegend"].visible.as_arrow_array().to_pylist() == [False] for view in plots)


def test_arrangement_has_the_same_names_in_every_recording(tmp_path: Path) -> None:
    """rerun keeps each name until the process ends: random ones would let the recorder grow for ever."""
    run, names = Run(50), []
    for _ in range(2):
        with closing(RecordingWriter(tmp_path / "run.rrd")) as writer:
            run.write(writer, 0, run.ticks)
        reader = RrdReader(writer.path)
        names.append({chunk.entity_path for chunk in reader.stream(store=reader.blueprints()[0])})
    assert names[0] == names[1]
    assert len(names[0]) > len(layout.TICKS)


def test_arranging_the_viewer_again_leaves_no_thread_behind() -> None:
    """A recording of many scans arranges it with each image."""
    stream = rr.RecordingStream(layout.APPLICATION)
    sent = rr.binary_stream(stream)
    stream.set_sinks(sent)
    threads = len(os.listdir("/proc/self/task"))
    for _ in range(3):
        streams.send_blueprint(stream, rrb.Blueprint(rrb.TimeSeriesView(origin="/a")))
        assert sent.read()
    assert len(os.listdir("/proc/self/task")) <= threads
    stream.disconnect()
    sent.read(flush=False)


def test_run_has_its_title_and_its_score_with_units_and_few_digits(tmp_path: Path) -> None:
    with closing(RecordingWriter(tmp_path / "run.rrd", title="Closed loop, tanh law")) as writer:
        writer.channel(layout.DEFLECTION, 0, PERIOD, np.zeros(10))
        writer.score(0, {"rms": {"x": 3.3181234567890123e-11, "y": 3.3e-11, "z": 7.037e-10}, "friction_min": 1.882e-07,
                         "friction_max": 1.908e-07, "ticks": 62832})  # fmt: skip
    found = (c.to_record_batch() for c in chunks(tmp_path / "run.rrd") if c.entity_path == layout.RUN)
    *_, text = [row[0] for batch in found for row in batch.column("TextDocument:text").to_pylist()]
    assert text.startswith("### Closed loop, tanh law")
    assert "| tracking error, rms [pm] | 33.18 | 33 | 703.7 |" in text
    assert "- friction 188.2 to 190.8 nN" in text and "- ticks 62832" in text
    # In the file it is whole.
    assert read_recording(tmp_path / "run.rrd").score["rms"]["x"] == 3.3181234567890123e-11
