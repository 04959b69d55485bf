"""Several recordings in one viewer: each as it is, below its name, the same signal of all in one plot."""

import subprocess
import sys
import urllib.request
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb
from recorded import Run, lines_of
from rerun.chunk import RrdReader
from support import TIMEOUT, executable

from afm_recorder_node import layout, view_command
from afm_recorder_node.complete import series
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import DamagedRecording, RecordingError
from afm_recorder_node.view_command import APPLICATION, COLORS, arrangement, main, names, together
from afm_recorder_node.writer import RecordingWriter


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Recordings of the same name in two folders; the second one with a scan."""
    paths = [tmp_path_factory.mktemp(name, numbered=False) / "recording.rrd" for name in ("tanh", "predictive-2")]
    for seed, path in enumerate(paths):
        run = Run(300, seed)
        with closing(RecordingWriter(path, title=path.parent.name)) as writer:
            run.write(writer, 0, run.ticks)
            for line in lines_of() if seed else ():
                writer.line(line)
    return paths


def test_recordings_are_called_by_what_tells_them_apart() -> None:
    assert names([Path("out/tanh/recording.rrd"), Path("out/pid.2/recording.rrd")]) == ["tanh", "pid_2"]
    assert names([Path("a.rrd"), Path("b.rrd")]) == ["a", "b"]
    assert names([Path("a/b.rrd"), Path("a/b.rrd")]) == ["recording_1", "recording_2"]


def test_every_signal_of_each_recording_is_there_below_its_name(two: list[Path], tmp_path: Path) -> None:
    together(two, tmp_path / "both.rrd")
    verify = [Path(sys.executable).with_name("rerun"), "rrd", "verify", tmp_path / "both.rrd"]
    assert subprocess.run(verify, capture_output=True, timeout=60).returncode == 0
    reader = RrdReader(tmp_path / "both.rrd")
    (store,) = reader.recordings()
    assert store.application_id == APPLICATION
    found: dict[str, list[np.ndarray]] = {}
    colors = {}
    for chunk in reader.stream(store=store):
        batch = chunk.to_record_batch()
        if chunk.is_static and "SeriesLines:colors" in batch.schema.names:
            colors[chunk.entity_path] = batch.column("SeriesLines:colors").to_pylist()[-1]
        rows = None if chunk.is_static else series(batch)
        if rows is not None:
            found.setdefault(chunk.entity_path, []).append(rows[1])
    for path, name in zip(two, ("tanh", "predictive_2"), strict=True):
        error = np.concatenate(found[f"/{name}/error"]).reshape(-1, 3)
        np.testing.assert_array_equal(error, 1e9 * read_recording(path).error)
    assert len({tuple(colors[f"/{name}/drive"]) for name in ("tanh", "predictive_2")}) == 2


def views(part: object) -> list[rrb.View]:
    if isinstance(part, rrb.View):
        return [part]
    return [view for inner in part.contents for view in views(inner)]


def test_one_plot_shows_a_signal_of_all_and_says_whose_is_which() -> None:
    there = {"tanh": {"/error"}, "pid": {"/error", "/scan/height/trace"}}
    root = arrangement(there).root_container
    assert [part.name for part in root.contents] == ["Scans", "Signals"]
    shown = views(root)
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
    spoiled = bytearray(two[0].read_bytes())
    spoiled[len(spoiled) // 2] ^= 1
    (tmp_path / "spoiled.rrd").write_bytes(spoiled)
    with pytest.raises(DamagedRecording):
        together([two[1], tmp_path / "spoiled.rrd"], tmp_path / "y.rrd")
    with pytest.raises(FileExistsError):
        together(two, two[0])


def test_what_cannot_be_shown_is_told_in_one_sentence(
    two: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    spoiled = bytearray(two[0].read_bytes())
    spoiled[len(spoiled) // 2] ^= 1
    (tmp_path / "spoiled.rrd").write_bytes(spoiled)
    (tmp_path / "words.json").write_text("{}")
    for given, told in (("spoiled.rrd", "is damaged"), ("words.json", "no .rrd file"), ("none.rrd", "no .rrd file")):
        monkeypatch.setattr(sys, "argv", ["view", str(tmp_path / given)])
        assert main() == 1
        (sentence,) = capfd.readouterr().err.splitlines()
        assert sentence.startswith(f"error: {tmp_path / given}") and told in sentence


def test_folder_is_all_recordings_in_it(two: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number, path in enumerate(two):
        (tmp_path / f"{number}.rrd").symlink_to(path)
    monkeypatch.setattr(sys, "argv", ["view", str(tmp_path), "--out", str(tmp_path / "all.out")])
    assert main() == 0
    assert (tmp_path / "all.out").stat().st_size > 0


def test_command_writes_a_file_or_serves_a_page(
    two: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [*map(str, two), "--out", str(tmp_path / "out.rrd")]
    assert subprocess.run([executable("afm_recorder_node", "view"), *arguments], timeout=TIMEOUT).returncode == 0
    assert (tmp_path / "out.rrd").stat().st_size > 0
    monkeypatch.setattr(sys, "argv", ["view", *arguments])
    assert main() == 1 and "nothing is overwritten" in capsys.readouterr().err
    for shown in (two, two[:1]):
        with view_command._served(shown) as link, urllib.request.urlopen(link.partition("?")[0]) as page:
            assert page.status == 200
