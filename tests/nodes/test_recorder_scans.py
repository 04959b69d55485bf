"""Scans in a view: the image grows in a bounded number of drawings, with a table of what it has come to."""

from pathlib import Path

import numpy as np
import rerun.blueprint as rrb
from recorded import SCAN, UNITS, line_message, lines_of
from viewed import chunks, column, events, panels, view

from afm_model.core.prefix import text
from afm_model.microscope.image import Image
from afm_recorder_node import layout, screens
from afm_recorder_node.scan_lines import ScanLine
from afm_recorder_node.scan_writer import LARGEST, STAGES, drawings


def scanned(path: Path, lines: list[ScanLine]) -> Path:
    return view(path, map(line_message, lines))


def expected(lines: list[ScanLine]) -> Image:
    image = Image.empty(lines[0].scan, lines[0].units)
    for line in lines:
        image.put(line.line)
    return image


def drawn(path: Path, entity: str) -> list[np.ndarray]:
    """Drawings of an image, in order of time."""
    found = []
    for chunk in chunks(path, entity):
        batch = chunk.to_record_batch()
        times = batch.column(layout.TIMELINE).cast("int64").to_pylist()
        for time, value in zip(times, batch.column("Tensor:data").to_pylist(), strict=True):
            found.append((time, np.array(value[0]["buffer"], np.float32).reshape(value[0]["shape"])))
    return [image for _, image in sorted(found, key=lambda each: each[0])]


def test_scans_of_one_run_are_drawn_in_order_also_one_that_was_cancelled(tmp_path: Path) -> None:
    down = SCAN.model_copy(update={"direction": "down", "size_y": 1e-6})
    first, second = lines_of(SCAN, 3), lines_of(down, 4, 100.0)
    path = scanned(tmp_path / "run.rrd", first[:31] + second)
    images = drawn(path, "/scan/height/trace")
    assert len(images) == 7 + STAGES
    # Of the line that was cut off there is the trace.
    assert [int((np.ptp(images[k], axis=1) > 0.0).sum()) for k in (6, -1)] == [16, SCAN.lines]
    # What is measured first of a scan downwards is at the largest y, which is at the top.
    np.testing.assert_allclose(images[-1][0], 1e9 * second[0].line.channels["height"], rtol=1e-6)
    assert [text for _, text in events(path)] == [
        "scan 3: 24 x 40 pixels, 2000 x 3333 nm, height, lateral",
        "scan 4: 24 x 40 pixels, 2000 x 1000 nm, height, lateral",
    ]


def test_image_grows_in_a_bounded_number_of_drawings_whose_last_is_the_whole(tmp_path: Path) -> None:
    lines = lines_of()
    path, whole = scanned(tmp_path / "run.rrd", lines), expected(lines)
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
    values, (low, high) = {entity: each for entity, *each in drawings(image)}["/scan/height/trace"]
    measured = np.isfinite(values)
    assert measured[-3:].all() and not measured[:-3].any()
    # No number stands for it, which would have a colour, and the colours are those of the heights about 1000 nm.
    assert 990.0 < low < high < 1010.0


def test_drawing_of_a_large_image_is_thinned(tmp_path: Path) -> None:
    path = scanned(tmp_path / "run.rrd", lines_of(SCAN.model_copy(update={"pixels": 4 * LARGEST, "lines": 3})))
    assert max(drawn(path, "/scan/height/trace")[-1].shape) == LARGEST


def test_every_image_has_a_view_with_its_unit_and_the_signals_stay() -> None:
    entities = [
        "/scan/crosstalk",
        "/scan/friction",
        "/scan/height/retrace",
        "/scan/height/trace",
        "/scan/truth/z/trace",
    ]
    tabs = screens.blueprint(entities).root_container
    assert [part.name for part in tabs.contents] == ["Scan", "Signals"]
    shown = {view.origin: view.name for view in panels(tabs.contents[0]) if isinstance(view, rrb.TensorView)}
    assert set(shown) == set(entities)
    # The trace of the height comes first.
    assert next(iter(shown)) == "/scan/height/trace"
    assert shown["/scan/height/trace"] == "Height, trace [nm]"
    assert shown["/scan/friction"] == "Friction [nN]"
    assert shown["/scan/truth/z/trace"] == "Truth/z, trace"
    signals = {view.origin for view in panels(tabs.contents[1])}
    assert {layout.EVENTS, layout.RUN} <= signals


def test_what_a_scan_has_come_to_is_told_next_to_its_images(tmp_path: Path) -> None:
    lines = lines_of()
    path = scanned(tmp_path / "run.rrd", lines[:40])
    tables = [row[0] for row in column(path, layout.RESULT, "TextDocument:text")]
    assert len(tables) == STAGES // 2
    words = max(tables, key=lambda each: int(each.split(" of 40 lines")[0].rsplit("\n", 1)[-1]))
    assert "### Scan 1" in words and "20 of 40 lines of 24 pixels, 2 µm x 3.333 µm, 4 Hz" in words
    values = expected(lines[:40]).data["height", "trace"]
    values = values[np.isfinite(values)] * 1e9
    shown = " | ".join(text(number * 1e-9, "m", 3) for number in (values.mean(), values.std(), values.min()))
    assert f"| height, trace | {shown} |" in words
    assert "| friction |" in words
