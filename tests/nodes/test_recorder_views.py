"""What the viewer shows of a run: the friction loop, and an arrangement in which nothing hides anything."""

import os
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb
from afm_msgs.msg import Score
from geometry_msgs.msg import Vector3
from recorded import Run
from viewed import column, panels, view

from afm_recorder_node import canvas, layout, screens
from afm_recorder_node.loop_drawing import HEIGHT, POINTS, ROWS, WIDTH, LoopPoints

PERIOD = 1e-3


def loop(path: Path, position: np.ndarray, force: np.ndarray) -> Path:
    """The view of a position along x [m] and a lateral force [N], two samples a tick."""
    run = Run(len(position), control_period=PERIOD)
    run.position = np.zeros((run.ticks, 3))
    run.position[:, 0], run.samples[1], run.scales = position, np.repeat(force, 2), (1.0,) * 4
    return view(path, run.messages())


def test_view_holds_the_friction_loop_with_its_ends(tmp_path: Path) -> None:
    phase = np.linspace(0.0, 2.0 * np.pi, 400)
    path = loop(tmp_path / "run.rrd", 5e-9 * np.sin(phase), 134e-9 * np.sign(np.cos(phase)))
    ((strip,),) = column(path, layout.FRICTION_LOOP, "LineStrips2D:strips")
    points = np.array(strip)
    assert points.shape == (400, 2)
    # From edge to edge of its frame; a position to the right is drawn to the right, a force upwards upwards.
    assert points.min(axis=0) == pytest.approx([0.0, 0.0], abs=1e-6)
    assert points.max(axis=0) == pytest.approx([WIDTH, HEIGHT], rel=1e-6)
    assert points[0, 1] == 0.0
    assert points[:, 0] == pytest.approx(WIDTH / 2 * (1.0 + np.sin(phase)), abs=1e-3)
    (labels,) = column(path, f"{layout.FRICTION_LOOP}/ends", "Points2D:labels")
    assert labels == ["-5 nm", "5 nm", "-134 nN", "134 nN"]


def test_run_without_motion_has_no_friction_loop(tmp_path: Path) -> None:
    path = loop(tmp_path / "run.rrd", np.zeros(100), np.zeros(100))
    assert column(path, layout.FRICTION_LOOP, "LineStrips2D:strips") == []


def test_friction_loop_of_a_long_run_is_that_of_its_end_and_takes_no_more_memory() -> None:
    loop = LoopPoints()
    count = ROWS // 4
    for block in range(12):
        times = np.arange(block * count, (block + 1) * count)
        loop.put(layout.POSITION.entity, times, np.column_stack([times, times, times]).astype(float))
        loop.put(layout.LATERAL_FORCE.entity, times, -times[:, np.newaxis].astype(float))
    points = loop.points()
    assert len(points) == POINTS
    assert points[0, 0] == 12 * count - ROWS
    assert points[:, 1] == pytest.approx(-points[:, 0])


def test_no_plot_of_the_arrangement_holds_two_axes_and_every_entity_is_shown() -> None:
    shown = panels(screens.blueprint(["/truth/creep_x"]).root_container)
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


def test_arranging_the_viewer_again_leaves_no_thread_behind() -> None:
    """The live page arranges it with each new image."""
    stream = rr.RecordingStream(layout.APPLICATION)
    sent = rr.binary_stream(stream)
    stream.set_sinks(sent)
    threads = len(os.listdir("/proc/self/task"))
    for _ in range(3):
        canvas.send_blueprint(stream, rrb.Blueprint(rrb.TimeSeriesView(origin="/a")))
        assert sent.read()
    assert len(os.listdir("/proc/self/task")) <= threads
    stream.disconnect()
    sent.read(flush=False)


def test_run_has_its_title_and_its_score_with_units_and_few_digits(tmp_path: Path) -> None:
    score = Score(rms=Vector3(x=3.3181234567890123e-11, y=3.3e-11, z=7.037e-10), ticks=62832, run_id=1)
    score.friction_min, score.friction_max = 1.882e-07, 1.908e-07
    messages = [*Run(10).messages(), ("score", score)]
    path = view(tmp_path / "run.rrd", messages, about={"title": "Closed loop, tanh law"})
    (text,) = column(path, layout.RUN, "TextDocument:text")[-1]
    assert text.startswith("### Closed loop, tanh law")
    assert "| tracking error, rms [pm] | 33.18 | 33 | 703.7 |" in text
    assert "- friction 188.2 to 190.8 nN" in text and "- ticks 62832" in text
    (text,) = column(view(tmp_path / "other.rrd", Run(10).messages()), layout.RUN, "TextDocument:text")[-1]
    assert text.startswith("### other") and "No score yet." in text
