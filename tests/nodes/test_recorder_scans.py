"""Scans in a recording: every line comes back as it was, the image grows in a bounded number of drawings."""

import logging
import signal
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb
from recorded import SCAN, UNITS, lines_of

from afm_model.core.prefix import text
from afm_model.microscope.image import Image
from afm_recorder_node import layout, screens
from afm_recorder_node.complete import chunks
from afm_recorder_node.parameters import RecorderParameters
from afm_recorder_node.pictures import LINES
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recorder import Recorder
from afm_recorder_node.recording import IncompleteRecording
from afm_recorder_node.scan_lines import ScanLine
from afm_recorder_node.scan_writer import LARGEST, STAGES, drawings
from afm_recorder_node.writer import RecordingWriter

PERIOD = 1e-3
HERE = Path(__file__).parent


def tick(writer: RecordingWriter) -> None:
    """A recording without a tick is none."""
    for channel in layout.CHANNELS:
        writer.channel(channel, 0, PERIOD, np.zeros(10))
    row = {name: np.zeros((10, 3)) for name in ("position", "reference", "drive")}
    writer.control(0, PERIOD, **row, deflection=np.zeros(10), round_trip=np.zeros(10))


def record(path: Path, lines: list[ScanLine]) -> Path:
    with closing(RecordingWriter(path)) as writer:
        tick(writer)
        for line in lines:
            writer.line(line)
    return path


def expected(lines: list[ScanLine]) -> Image:
    image = Image.empty(lines[0].scan, lines[0].units)
    for line in lines:
        image.put(line.line)
    return image


def drawn(path: Path, entity: str) -> list[np.ndarray]:
    """Drawings of an image, in order of time."""
    found = []
    for chunk in chunks(path, whole=False):
        if chunk.entity_path == entity and not chunk.is_static:
            batch = chunk.to_record_batch()
            times = batch.column(layout.TIMELINE).cast("int64").to_pylist()
            for time, value in zip(times, batch.column("Tensor:data").to_pylist(), strict=True):
                tensor = value[0]
                found.append((time, np.array(tensor["buffer"], np.float32).reshape(tensor["shape"])))
    return [image for _, image in sorted(found, key=lambda each: each[0])]


def test_image_comes_back_to_the_last_bit_with_its_frame_and_times(tmp_path: Path) -> None:
    lines = lines_of()
    recording = read_recording(record(tmp_path / "run.rrd", lines))
    (image,), whole = recording.images, expected(lines)
    assert image.complete and image.lines_done == SCAN.lines
    assert image.scan == SCAN and image.units == UNITS
    for key, values in whole.data.items():
        np.testing.assert_array_equal(image.data[key], values)
    assert image.start == 1.0
    assert image.line_rate == pytest.approx(3.0, rel=1e-12)
    assert any("scan 1: 24 x 40 pixels, 2000 x 3333 nm" in text for _, text in recording.events)
    # An image is no channel of the detector.
    assert set(recording.channels) == {signal.name for signal in layout.CHANNELS}
    verify = [Path(sys.executable).with_name("rerun"), "rrd", "verify", tmp_path / "run.rrd"]
    assert subprocess.run(verify, capture_output=True, timeout=60).returncode == 0


def test_scans_of_one_run_are_images_in_order_also_one_that_was_cancelled(tmp_path: Path) -> None:
    down = SCAN.model_copy(update={"direction": "down", "size_y": 1e-6})
    first, second = lines_of(SCAN, 3), lines_of(down, 4, 100.0)
    recording = read_recording(record(tmp_path / "run.rrd", first[:31] + second))
    assert [image.complete for image in recording.images] == [False, True]
    part, whole = recording.images
    assert part.lines_done == 15
    # Of the line that was cut off there is the trace.
    assert np.isfinite(part.data["height", "trace"]).all(axis=1).sum() == 16
    assert np.isfinite(part.data["height", "retrace"]).all(axis=1).sum() == 15
    # What is measured first of a scan downwards is at the largest y.
    np.testing.assert_array_equal(whole.data["height", "trace"][-1], second[0].line.channels["height"])
    assert len(drawn(tmp_path / "run.rrd", "/scan/height/trace")) == 7 + STAGES


def test_image_grows_in_a_bounded_number_of_drawings_whose_last_is_the_whole(tmp_path: Path) -> None:
    lines = lines_of()
    path, whole = record(tmp_path / "run.rrd", lines), expected(lines)
    grown = drawn(path, "/scan/friction")
    assert len(grown) == STAGES
    # What is not measured yet is as dark as the lowest.
    measured = [int((np.ptp(image, axis=1) > 0.0).sum()) for image in grown]
    assert measured == sorted(set(measured)) and measured[-1] == SCAN.lines
    # In nN, the largest y at the top.
    np.testing.assert_allclose(grown[-1], 1e9 * whole.friction()[::-1], rtol=1e-6)
    assert np.isfinite(grown[0]).all() and np.ptp(grown[0][0]) == 0.0 < np.ptp(grown[0][-1])


def test_what_is_not_measured_yet_has_no_colour_and_takes_none_from_what_is() -> None:
    image = Image.empty(SCAN, UNITS)
    for line in lines_of()[:6]:
        line.line.channels["height"] += 1e-6
        image.put(line.line)
    drawing = next(each for each in drawings(image) if each.entity == "/scan/height/trace")
    low, high = drawing.span
    measured = np.isfinite(drawing.values)
    assert measured[-3:].all() and not measured[:-3].any()
    # No number stands for it, which would have a colour, and the colours are those of the heights about 1000 nm.
    assert 990.0 < low < high < 1010.0


def test_drawing_of_a_large_image_is_thinned_and_its_lines_are_not(tmp_path: Path) -> None:
    large = SCAN.model_copy(update={"pixels": 4 * LARGEST, "lines": 3})
    path = record(tmp_path / "run.rrd", lines_of(large))
    assert max(drawn(path, "/scan/height/trace")[-1].shape) == LARGEST
    assert read_recording(path).images[0].data["height", "trace"].shape == (3, 4 * LARGEST)


def test_killed_recorder_leaves_the_image_so_far(tmp_path: Path) -> None:
    code = (
        "import os, signal, sys; from pathlib import Path; sys.path += sys.argv[2:]\n"
        "from test_recorder_scans import RecordingWriter, lines_of, tick\n"
        "writer = RecordingWriter(Path(sys.argv[1]))\n"
        "tick(writer)\n"
        "for line in lines_of()[:50]:\n    writer.line(line)\n"
        "writer.flush()\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    program = [sys.executable, "-c", code, tmp_path / "run.rrd", HERE, HERE.parent]
    assert subprocess.run(program, timeout=60, check=False).returncode == -signal.SIGKILL
    partial = tmp_path / "run.partial.rrd"
    with pytest.warns(IncompleteRecording):
        (image,) = read_recording(partial).images
    assert image.lines_done == 25 and not image.complete
    for key, values in expected(lines_of()[:50]).data.items():
        np.testing.assert_array_equal(image.data[key], values)
    assert (np.ptp(drawn(partial, "/scan/height/trace")[-1], axis=1) > 0.0).sum() == 25


def test_lost_lines_are_counted_and_late_ones_are_not_missing(tmp_path: Path) -> None:
    recorder = Recorder(RecorderParameters(path=str(tmp_path / "run.rrd")), logging.getLogger("recorder"))
    lines = lines_of()
    for line in (*lines[:10], *lines[13:], *lines_of(SCAN, 2, 100.0)[1:]):
        recorder.line(line)
    counts = recorder.counts()
    assert (counts.lines, counts.lines_lost) == (2 * len(lines) - 4, 4)
    recorder.close()


def test_lines_that_cannot_be_written_are_left_out_and_told(tmp_path: Path) -> None:
    import resource

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    writer = RecordingWriter(tmp_path / "run.rrd")
    tick(writer)
    lines = lines_of()
    for line in lines[:20]:
        writer.line(line)
    writer.flush()
    resource.setrlimit(resource.RLIMIT_FSIZE, (writer.partial.stat().st_size, limits[1]))
    try:
        writer.line(lines[20])  # kept: it is there when writing fails
        writer.flush()
        for line in lines[21:30]:
            writer.line(line)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    writer.flush()
    for line in lines[30:]:
        writer.line(line)
    writer.close()
    recording = read_recording(tmp_path / "run.rrd")
    (image,) = recording.images
    assert np.isnan(image.data["height", "trace"]).all(axis=1).sum() == 4
    assert any("9 lines of scans" in text and "are missing" in text for _, text in recording.events)


def views(part: object) -> list[rrb.View]:
    if isinstance(part, rrb.View):
        return [part]
    return [view for inner in part.contents for view in views(inner)]


def test_every_image_has_a_view_with_its_unit_and_the_signals_stay(tmp_path: Path) -> None:
    entities = [
        "/scan/crosstalk",
        "/scan/friction",
        "/scan/height/retrace",
        "/scan/height/trace",
        "/scan/truth/z/trace",
    ]
    tabs = screens.blueprint(entities).root_container
    assert [part.name for part in tabs.contents] == ["Scan", "Signals"]
    shown = {view.origin: view.name for view in views(tabs.contents[0]) if isinstance(view, rrb.TensorView)}
    assert set(shown) == set(entities)
    # The trace of the height comes first.
    assert next(iter(shown)) == "/scan/height/trace"
    assert shown["/scan/height/trace"] == "Height, trace [nm]"
    assert shown["/scan/friction"] == "Friction [nN]"
    assert shown["/scan/truth/z/trace"] == "Truth/z, trace"
    signals = {view.origin for view in views(tabs.contents[1])}
    assert {layout.EVENTS, layout.RUN} <= signals
    assert LINES not in shown


def test_what_a_scan_has_come_to_is_told_beside_its_images(tmp_path: Path) -> None:
    lines = lines_of()
    path = record(tmp_path / "run.rrd", lines[:40])
    batches = [c.to_record_batch() for c in chunks(path) if c.entity_path == layout.RESULT]
    rows = [row[0] for batch in batches for row in batch.column("TextDocument:text").to_pylist()]
    assert len(rows) == STAGES // 2
    words = max(rows, key=lambda each: int(each.split(" of 40 lines")[0].rsplit("\n", 1)[-1]))
    assert "### Scan 1" in words and "20 of 40 lines of 24 pixels, 2 µm x 3.333 µm, 4 Hz" in words
    values = expected(lines[:40]).data["height", "trace"]
    values = values[np.isfinite(values)] * 1e9
    shown = " | ".join(text(number * 1e-9, "m", 3) for number in (values.mean(), values.std(), values.min()))
    assert f"| height, trace | {shown} |" in words
    assert "| friction |" in words
