"""Several recordings in one viewer: each as it is, below its name, the same signal of all in one plot."""

import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from recorded import HEIGHT, Run, line_message, lines_of, record
from support import TIMEOUT, executable
from viewed import column, panels, series

from afm_recorder_node import layout, view_command
from afm_recorder_node.recording import DamagedRecording, RecordingError
from afm_recorder_node.view_command import COLORS, arrangement, main, names, together


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Recordings of the same name in two folders; the second one with a scan."""
    paths = [tmp_path_factory.mktemp(name, numbered=False) / "recording.mcap" for name in ("tanh", "predictive-2")]
    for seed, path in enumerate(paths):
        lines = map(line_message, lines_of()) if seed else ()
        record(path, [*Run(300, seed).messages(), *lines], about={"title": path.parent.name})
    return paths


def spoiled(path: Path, source: Path) -> Path:
    data = bytearray(source.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    return path


def test_recordings_are_called_by_what_tells_them_apart() -> None:
    assert names([Path("out/tanh/recording.rrd"), Path("out/pid.2/recording.rrd")]) == ["tanh", "pid_2"]
    assert names([Path("a.rrd"), Path("b.rrd")]) == ["a", "b"]
    assert names([Path("a/b.rrd"), Path("a/b.rrd")]) == ["recording_1", "recording_2"]


def test_every_signal_of_each_recording_is_there_below_its_name(two: list[Path], tmp_path: Path) -> None:
    path = tmp_path / "both.rrd"
    together(two, path)
    verify = [Path(sys.executable).with_name("rerun"), "rrd", "verify", path]
    assert subprocess.run(verify, capture_output=True, timeout=60).returncode == 0
    for seed, name in enumerate(("tanh", "predictive_2")):
        run = Run(300, seed)
        tip = HEIGHT + run.deflection - run.reference[:, 2]
        np.testing.assert_allclose(series(path, f"/{name}/error")[1][:, 2], 1e9 * tip, rtol=1e-12)
        assert column(path, f"/{name}{layout.FRICTION_LOOP}", "LineStrips2D:strips")
    colors = [str(column(path, f"/{name}/drive", "SeriesLines:colors")) for name in ("tanh", "predictive_2")]
    assert colors[0] != colors[1]


def test_one_plot_shows_a_signal_of_all_and_says_whose_is_which() -> None:
    there = {"tanh": {"/error"}, "pid": {"/error", "/scan/height/trace"}}
    root = arrangement(there).root_container
    assert [part.name for part in root.contents] == ["Scans", "Signals"]
    shown = panels(root)
    plots = [view for view in shown if view.contents == ["/tanh/error", "/pid/error"]]
    assert len(plots) == 3
    assert plots[0].name == "Tracking error (tanh red, pid blue), x [nm]"
    # Each axis is in one of them, of both recordings.
    for axis, plot in enumerate(plots):
        for lines in plot.visualizer_overrides.values():
            ((values,),) = (lines.overrides,)
            assert values.as_arrow_array().to_pylist() == [k == axis for k in range(3)]
    assert {f"/{name}{layout.FRICTION_LOOP}" for name in there} <= {view.origin for view in shown}
    assert "/pid/scan/height/trace" in {view.origin for view in shown}


def test_what_cannot_be_shown_together_is_refused(two: list[Path], tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=f"1 recordings are not allowed: it must be 2 to {len(COLORS)}"):
        together(two[:1], tmp_path / "x.rrd")
    with pytest.raises(DamagedRecording):
        together([two[1], spoiled(tmp_path / "spoiled.mcap", two[0])], tmp_path / "y.rrd")
    with pytest.raises(OSError, match="nothing is overwritten"):
        together(two, two[0])


def test_what_cannot_be_shown_is_told_in_one_sentence(
    two: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    spoiled(tmp_path / "spoiled.mcap", two[0])
    (tmp_path / "words.mcap").write_text("{}")
    for given, told in (("spoiled.mcap", "is damaged"), ("words.mcap", "not an .mcap file"), ("none.mcap", "no .mcap")):
        monkeypatch.setattr(sys, "argv", ["view", str(tmp_path / given)])
        assert main() == 1
        (sentence,) = capfd.readouterr().err.splitlines()
        assert sentence.startswith(f"error: {tmp_path / given}") and told in sentence


def test_folder_is_all_recordings_in_it(two: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number, path in enumerate(two):
        (tmp_path / f"{number}.mcap").symlink_to(path)
    monkeypatch.setattr(sys, "argv", ["view", str(tmp_path), "--out", str(tmp_path / "all.rrd")])
    assert main() == 0
    assert len(series(tmp_path / "all.rrd", "/0/drive")[0]) == len(series(tmp_path / "all.rrd", "/1/drive")[0]) == 300


def test_command_writes_a_file_or_serves_a_page(
    two: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [*map(str, two), "--out", str(tmp_path / "out.rrd")]
    assert subprocess.run([executable("afm_recorder_node", "view"), *arguments], timeout=TIMEOUT).returncode == 0
    assert len(series(tmp_path / "out.rrd", "/tanh/drive")[0]) == 300
    monkeypatch.setattr(sys, "argv", ["view", *arguments])
    assert main() == 1 and "nothing is overwritten" in capsys.readouterr().err
    monkeypatch.setattr(sys, "argv", ["view", str(two[0]), "--out", str(tmp_path / "one.rrd")])
    assert main() == 0 and len(series(tmp_path / "one.rrd", "/drive")[0]) == 300
    for shown in (two, two[:1]):
        with view_command._served(shown) as link, urllib.request.urlopen(link.partition("?")[0]) as page:
            assert page.status == 200
