"""`ros2 run afm_bringup scan`: a first image over real actions, in files that agree with one another and the sample."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from gwyfile import load
from gwyfile.util import get_datafields
from PIL import Image as Picture
from scipy.ndimage import binary_erosion
from support import TIMEOUT, Command, assert_nothing_left, executable, remove_shared_memory_left

from afm_bringup import scan_command
from afm_bringup.files import config
from afm_bringup.remote import Remote
from afm_bringup.scan_command import STEP, STRENGTH, letter, second_material, write_sample
from afm_model.core.errors import VerbError
from afm_model.microscope import Microscope
from afm_recorder_node.inspect_command import main as inspect
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import Recording

SIZE, PIXELS = 1e-6, 48


def scan(out: Path, *options: str, folder: Path) -> Command:
    return Command(executable("afm_bringup", "scan"), "--out", out, *options, folder=folder)


@dataclass
class Made:
    """What a scan has left."""

    folder: Path
    printed: str
    fields: dict[str, np.ndarray]  # by title, row 0 at the least y
    recording: Recording


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    folder = tmp_path_factory.mktemp("scan")
    frame = ("--pixels", str(PIXELS), "--lines", str(PIXELS), "--line-rate", "8")
    with scan(folder / "out", *frame, folder=folder) as process:
        assert process.wait(timeout=3.0 * TIMEOUT) == 0, process.told
        printed = process.text
    assert_nothing_left()
    channels = get_datafields(load(str(folder / "out" / "scan.gwy")))
    fields = {title: field.data[::-1] for title, field in channels.items()}
    assert {field.si_unit_z.unitstr for title, field in channels.items() if title.startswith("Height")} == {"m"}
    return Made(folder / "out", printed, fields, read_recording(folder / "out" / "recording.rrd"))


def places() -> tuple[np.ndarray, np.ndarray]:
    along = (np.arange(PIXELS) + 0.5) / PIXELS * SIZE - 0.5 * SIZE
    x, y = np.meshgrid(along, along)
    return x, y


def inner(part: np.ndarray) -> np.ndarray:
    """A part without its border: the tip is as wide as a pixel, the loop as slow as one."""
    return binary_erosion(part, np.ones((3, 3)), border_value=1)


def test_results_stand_under_their_names_and_nothing_else(made: Made) -> None:
    files = {"recording.mcap", "recording.rrd", "scan.png", "channels.png", "scan.gwy", "scan.sxm", "scan.csv"}
    assert {path.name for path in made.folder.iterdir()} == files | {"sample", "logs"}
    for name in ("scan.png", "channels.png"):
        with Picture.open(made.folder / name) as picture:
            assert min(picture.size) > 400
    for name in files:
        assert f"out/{name}" in made.printed


def test_height_shows_the_letter_upright_with_its_step_within_1_percent(made: Made) -> None:
    height, up = made.fields["Height"], letter(*places())
    step = np.median(height[inner(up)]) - np.median(height[inner(~up)])
    assert step == pytest.approx(STEP, rel=0.01)
    # Any other orientation of it would fit far worse.
    fits = [
        np.corrcoef(turned.ravel(), up.ravel())[0, 1] for turned in (height, height[::-1], height[:, ::-1], height.T)
    ]
    assert fits[0] > 0.8 > 0.6 > max(fits[1:])


def test_friction_tells_the_materials_apart_within_3_percent_and_the_height_does_not(made: Made) -> None:
    x, y = places()
    flat, second = inner(~letter(x, y)), second_material(x, y)
    there, here = flat & inner(second), flat & inner(~second)
    friction = made.fields["Friction"]
    assert np.median(friction[there]) / np.median(friction[here]) == pytest.approx(STRENGTH, rel=0.03)
    # Less than a hundredth of the step.
    height = made.fields["Height"]
    assert abs(np.median(height[there]) - np.median(height[here])) < 0.01 * STEP


def test_recording_holds_the_same_image_to_the_last_bit(made: Made) -> None:
    (image,) = made.recording.images
    assert image.complete and image.scan.size_x == SIZE
    for title, key in (("Height", ("height", "trace")), ("Lateral Force Retrace", ("lateral", "retrace"))):
        np.testing.assert_array_equal(made.fields[title], image.data[key])
    rerun = Path(sys.executable).with_name("rerun")
    for question in (
        ("rrd", "verify", made.folder / "recording.rrd"),
        ("mcap", "check", made.folder / "recording.mcap"),
    ):
        assert subprocess.run([rerun, *question], capture_output=True, timeout=60).returncode == 0


def test_inspect_tells_the_scan_and_its_verbs(made: Made, capsys: pytest.CaptureFixture[str]) -> None:
    assert inspect([str(made.folder / "recording.rrd")]) == 0
    said = capsys.readouterr().out
    assert f"{PIXELS} of {PIXELS} lines, height, error, lateral" in said
    assert "Scan was done" in said and "plant lever" in said and "z_loop_error" in said


TAPPED = {"size_x": SIZE, "pixels": 40, "lines": 10, "line_rate": 8.0}
"""Across both bars of the letter that go up and down, and its short one."""


@pytest.fixture(scope="module")
def tapped(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """What `scan --mode tapping` has left."""
    folder = tmp_path_factory.mktemp("tapped")
    frame = [f"--{name.replace('_', '-')}={value}" for name, value in TAPPED.items()]
    with scan(folder / "out", "--mode", "tapping", *frame, folder=folder) as process:
        assert process.wait(timeout=3.0 * TIMEOUT) == 0, process.told
        printed = process.text
    assert_nothing_left()
    channels = get_datafields(load(str(folder / "out" / "scan.gwy")))
    fields = {title: field.data[::-1] for title, field in channels.items()}
    return Made(folder / "out", printed, fields, read_recording(folder / "out" / "recording.rrd"))


@pytest.mark.long
def test_image_by_tapping_over_actions_is_that_of_the_same_verbs_in_process_to_the_last_byte(tapped: Made) -> None:
    (over_topics,) = tapped.recording.images
    with Microscope(config("first_tapping.yaml"), sample=write_sample(tapped.folder / "again")) as microscope:
        microscope.approach()
        microscope.scan(**TAPPED)
        assert microscope.outcome is not None
        here = microscope.outcome.result
    assert over_topics.units == here.units == {"height": "m", "amplitude_error": "m", "phase": "rad"}
    assert over_topics.complete
    for key, values in here.data.items():
        assert over_topics.data[key].tobytes() == values.tobytes(), key
    assert here.metadata["Drive"] == "77 kHz, 85 pm (base)"
    # The same in the file for Gwyddion, with the notes.
    notes = load(str(tapped.folder / "scan.gwy"))["/0/meta"]
    assert {name: notes[name] for name in here.metadata} == here.metadata
    for title, key in (("Height", "height"), ("Phase", "phase"), ("Amplitude Error", "amplitude_error")):
        np.testing.assert_array_equal(tapped.fields[title], here.data[key, "trace"])


@pytest.mark.long
def test_image_by_tapping_shows_the_letter_with_its_step_within_1_percent_and_one_phase_on_both_materials(
    tapped: Made,
) -> None:
    along = (np.arange(TAPPED["pixels"]) + 0.5) / TAPPED["pixels"] * SIZE - 0.5 * SIZE
    x, y = np.meshgrid(along, along[:10] - along[:10].mean())
    height, up, second = tapped.fields["Height"], letter(x, y), second_material(x, y)
    flat, top = inner(~up), inner(up)
    assert np.median(height[top]) - np.median(height[flat]) == pytest.approx(STEP, rel=0.01)
    # They differ in friction, which a tip that taps hardly feels: below pi/2, the branch of repulsion, on both.
    phase = tapped.fields["Phase"]
    there, here = (np.median(phase[flat & inner(each)]) for each in (second, ~second))
    assert there == pytest.approx(here, abs=0.01)
    assert 0.6 < here < 0.5 * np.pi


@pytest.mark.long
def test_interrupted_scan_leaves_the_image_up_to_there_and_no_process(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with scan(out, "--pixels", "32", "--lines", "2000", "--line-rate", "20", folder=tmp_path) as process:
        process.wait_until(lambda: any((each / "recording.mcap").exists() for each in out.glob("unfinished-*")))
        process.wait_until(lambda: "Approach: done" in process.text)
        process.interrupt()
        assert process.wait() == 130, process.told
    remove_shared_memory_left()
    assert (out / "recording.rrd").exists()
    log = (out / "logs" / "afm_sim_node.log").read_text()
    assert "Traceback" not in log + process.text


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--lines", "0"), "lines = 0 is not allowed"),
        (("--size-x", "nan"), "size_x = nan"),
        (("closed_loop_tanh",), "reference.kind = periodic is not allowed in a scan: it must be verbs"),
        (("no_such",), "no_such"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence_before_anything_starts(
    options: tuple[str, ...],
    sentence: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["scan", "--out", str(tmp_path / "out"), *options])
    assert scan_command.main() == 2
    told = capsys.readouterr().err
    assert sentence in told and len(told.splitlines()) == 1


def test_client_without_a_microscope_says_where_it_has_looked() -> None:
    with pytest.raises(VerbError, match="there is no microscope on /nobody in ROS domain"):
        Remote("nobody", patience=0.2)
