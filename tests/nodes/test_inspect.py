"""`inspect` answers what is asked of a recording; each number is held against one that is known without it."""

import csv
import math
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from afm_msgs.msg import InstrumentStatus, Score
from recorded import CONTROL_PERIOD, PERIOD, Run, begin, line_message, lines_of, parameters, put, record, stamp, status
from rich.console import Console
from scipy.signal import welch

from afm_model import load_scenario
from afm_model.analysis import dissipated, friction_loop
from afm_model.core.schema import flatten
from afm_recorder_node import inspect_command, layout, questions
from afm_recorder_node.inspect_command import main, row
from afm_recorder_node.places import recordings
from afm_recorder_node.reader import read_recording, read_signals
from afm_recorder_node.repair import repair
from afm_recorder_node.spectrum import longest_stretch, read_spectrum, spectrum
from afm_recorder_node.statistics import Gathered

TICKS = 4000


def made(path: Path, run: Run | None = None, *, close: bool = True, without: slice | None = None) -> Path:
    """A recording of a run with the parameters of the demo but one."""
    run = run or Run(TICKS)
    scenario = load_scenario("closed_loop_tanh")
    over = CONTROL_PERIOD * run.ticks
    score = Score(ticks=run.ticks, valid=True, stick_fraction=0.05, run_id=1)
    score.header.stamp = stamp(over)
    score.rms.x, score.rms.y, score.rms.z = 3.3177e-11, 2e-9, 7e-10
    writer = begin(
        path,
        [
            parameters("afm_sim_node", flatten(scenario.sim) | {"process.cpu": -1}),
            parameters("afm_controller_node", flatten(scenario.controller) | {"law.alpha": 12.5}),
            status(0.0, InstrumentStatus.RUNNING),
        ],
    )
    for start in range(0, run.ticks, 500):
        if without is None or start not in range(without.start, without.stop):
            put(writer, run.block(start, start + 500))
    put(writer, [status(over, InstrumentStatus.FINISHED), ("score", score)])
    if close:
        writer.close({"missing": ""})
    return path


def test_one_screen_tells_scenario_parts_law_events_score_and_signals(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(made(tmp_path / "run.mcap"))]) == 0
    said = capsys.readouterr().out
    assert "closed_loop_tanh with law.alpha = 12.5" in said
    for part in (
        "plant compliant",
        "law       tanh",
        "8 ms, 4000 ticks of 2 µs (500 kHz)",
        "controller law.alpha  12.5",
    ):
        assert part in said, said
    lines = [line.split() for line in said.splitlines()]
    for line in ("0 s 8 ms RUNNING", "tracking error, rms [nm] 0.03318 2 0.7"):
        assert line.split() in lines, said
    run = Run(TICKS)
    deflection = next(line.split() for line in said.splitlines() if line.startswith("deflection "))
    values = run.samples[0] * run.scales[0] * 1e9
    assert deflection[1:4] == ["1", "MHz", "8000"]
    assert [float(each) for each in deflection[4:8]] == pytest.approx(
        [values.min(), values.max(), values.mean(), np.sqrt(np.mean(values**2))], rel=1e-3
    )
    assert deflection[8:] == ["nm", "none"]


def test_statistics_of_stretches_are_those_of_the_whole_and_tell_gaps_and_nan() -> None:
    rng = np.random.default_rng(3)
    times = np.delete(np.arange(1000) * 2000, [0, 300, 301, 777])
    values = rng.normal(5.0, 2.0, (len(times), 3))
    values[17, 1] = np.nan
    gathered = Gathered()
    for stretch in (slice(500, None), slice(0, 200), slice(200, 500)):  # as chunks come, in any order
        gathered.put(times[stretch], values[stretch])
    x, y, _ = gathered.statistics(layout.DRIVE)
    assert x.gaps == y.gaps == [(0.000598, 2), (0.001552, 1)]
    assert (x.rows, x.period, x.begin, x.end) == (996, 2e-6, 2e-6, 0.001998)
    assert (x.unknown, y.unknown) == (0, 1)
    for i, each in enumerate((x, y)):
        known = values[~np.isnan(values[:, i]), i]
        assert (each.low, each.high) == (known.min(), known.max())
        assert (each.mean, each.rms) == pytest.approx((known.mean(), np.sqrt(np.mean(known**2))), rel=1e-12, abs=0.0)
    gathered = Gathered()
    gathered.put(np.array([0, 1000, 2001, 7000]), np.zeros((4, 1)))
    (irregular,) = gathered.statistics(layout.DEFLECTION)
    assert irregular.gaps == [(2.001e-6, 4)]


def test_signal_is_cut_in_time_and_written_with_all_its_digits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, run = made(tmp_path / "run.mcap"), Run(TICKS)
    files = {each: tmp_path / f"out.{each}" for each in ("csv", "parquet", "png")}
    options = ["--csv", str(files["csv"]), "--parquet", str(files["parquet"]), "--plot", str(files["png"])]
    assert main([str(path), "--signal", "drive.y", "--from", "1e-3", "--to", "3e-3", *options]) == 0
    expected = run.drive[500:1501, 1]
    assert " 1001 " in capsys.readouterr().out
    with open(files["csv"], newline="") as file:
        written = [float(each["drive.y_V"]) for each in csv.DictReader(file)]
    assert written == expected.tolist() == pq.read_table(files["parquet"])["drive.y_V"].to_pylist()
    assert files["png"].read_bytes().startswith(b"\x89PNG")
    assert main([str(path), "--psd", "drive.y", "--csv", str(files["csv"])]) == 0
    assert files["csv"].read_text().splitlines()[0] == '"frequency_Hz","density_V^2/Hz"'
    whole = read_recording(path)
    for name, values in (("position", whole.position), ("truth/normal_force", whole.normal_force)):
        assert np.array_equal(read_signals(path, [name])[name].values, values)


def test_unknown_names_places_and_columns_are_told_with_those_that_are_near(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(made(tmp_path / "run.mcap"))
    for asked, told in (
        ([path, "--signal", "deflektion"], "did you mean deflection"),
        ([path, "--psd", "truth/normal_forc"], "did you mean truth/normal_force"),
        ([path, "--psd", "position.xy"], "did you mean position"),
        ([path, "--signal", "position."], "did you mean position"),
        ([path, "--signal", "qqq"], "there is deflection, drive, error"),
        ([path, "--table", "--sort", "rms"], "rms_x"),
        ([str(tmp_path / "none*.mcap")], "no readable recording"),
        ([path, "--signal", "drive", "--from", "1"], "no row"),
        ([path, "--signal", "deflection.x"], "deflection has no axes"),
        ([path, "--psd", "drive", "--to", "1e-4"], "51 samples without a gap"),
    ):
        assert main(asked) == 2
        assert told in capsys.readouterr().err


def test_spectrum_has_the_level_of_white_noise_and_the_amplitude_of_a_line() -> None:
    rate, level, amplitude, f = 1e5, 3e-13, 2e-9, 12345.6
    rng = np.random.default_rng(5)
    t = np.arange(400_000) / rate
    values = 5e-9 + amplitude * np.sin(2.0 * np.pi * f * t) + rng.normal(0.0, level * math.sqrt(rate / 2.0), t.size)
    values[1000] = np.nan  # the longest stretch without a gap counts
    stretch, period = longest_stretch(t, values)
    np.testing.assert_array_equal(stretch, values[1001:])
    assert period == pytest.approx(1.0 / rate, rel=1e-12, abs=0.0)
    found = spectrum(stretch, period)
    assert found.floor == pytest.approx(level, rel=0.05, abs=0.0)
    (line, rms), *others = found.lines()
    assert not others
    assert (line, rms) == (pytest.approx(f, abs=1.0), pytest.approx(amplitude / math.sqrt(2.0), rel=2e-3, abs=0.0))
    step = found.frequency[1] - found.frequency[0]
    assert found.density.sum() * step == pytest.approx(found.rms**2, rel=0.01, abs=0.0)


def test_spectrum_of_a_recording_is_that_of_scipy_in_its_units(tmp_path: Path) -> None:
    run = Run(TICKS)
    name, unit, found = read_spectrum(made(tmp_path / "run.mcap", run), "drive.z")
    assert (name, unit, found.samples) == ("drive.z", "V", TICKS)
    assert found.rms == pytest.approx(run.drive[:, 2].std(), rel=1e-12, abs=0.0)
    _, unit, found = read_spectrum(tmp_path / "run.mcap", "deflection")
    frequency, density = welch(run.samples[0] * run.scales[0], 1.0 / PERIOD, nperseg=512, detrend="constant")
    np.testing.assert_allclose(found.density, density[1:], rtol=1e-9)
    np.testing.assert_allclose(found.frequency, frequency[1:], rtol=1e-12)
    assert unit == "m"


@pytest.mark.parametrize("periods", [1, 3])
def test_loop_has_the_width_the_slope_and_the_energy_that_it_was_made_with(tmp_path: Path, periods: int) -> None:
    # A tip on a spring of 2 N/m that slides at 100 nN, below a scanner that goes +-500 nm: a parallelogram.
    stiffness, friction, reach, offset = 2.0, 100e-9, 500e-9, 7e-9
    ticks = 4000 * periods
    phase = np.arange(ticks) / 4000.0
    position = reach * (4.0 * np.abs((phase - 0.25) % 1.0 - 0.5) - 1.0)
    force, forces = 0.0, np.empty(ticks)
    for _ in range(2):  # the first time through ends where the second begins
        last = position[-1]
        for k in range(ticks):
            force = float(np.clip(force + stiffness * (position[k] - last), -friction, friction))
            last, forces[k] = position[k], force + offset
    run = Run(ticks)
    run.position[:, 0] = position
    run.samples[1] = np.interp(np.arange(2 * ticks) * PERIOD, np.arange(ticks) * CONTROL_PERIOD, forces) / run.scales[1]
    found = questions.loop(made(tmp_path / "loop.mcap", run))
    assert found.found.half_width.value == pytest.approx(friction, rel=1e-6, abs=0.0)
    assert found.found.offset.value == pytest.approx(offset, rel=1e-6, abs=0.0)
    assert found.found.stick_slope.value == pytest.approx(stiffness, rel=1e-3, abs=0.0)
    # The area of the parallelogram: its height times the way that the tip slides.
    assert found.energy == pytest.approx(2.0 * friction * (2.0 * reach - 2.0 * friction / stiffness), rel=1e-3, abs=0.0)


def test_scanner_that_rests_while_the_tip_sticks_has_a_loop_without_a_slope() -> None:
    way = np.clip(1.3 * np.sin(np.arange(0.0, 25.0, 0.01)), -1.0, 1.0)
    force = np.zeros_like(way)
    for k in range(1, len(way)):
        force[k] = np.sign(way[k] - way[k - 1]) if way[k] != way[k - 1] else force[k - 1] * 0.97
    found = friction_loop(way, force)
    assert found.half_width.value == pytest.approx(1.0, rel=0.1, abs=0.0)
    assert dissipated(way, force)[0] > 0.0


def test_compare_names_the_tick_the_channel_and_the_size_of_the_first_difference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, run = made(tmp_path / "one.mcap"), Run(TICKS)
    same = made(tmp_path / "same.mcap", run)
    assert main([str(one), "--compare", str(same)]) == 0
    assert "no difference" in capsys.readouterr().out
    before = float(run.drive[1234, 2])
    run.drive[1234, 2] = np.nextafter(before, np.inf)
    run.position[1235:, 0] += 1e-12
    run.round_trip += 1.0  # wall time
    assert main([str(one), "--compare", str(made(tmp_path / "other.mcap", run))]) == 1
    said = capsys.readouterr().out
    assert "The first tick that differs is 1234, at 0.002468 s, in drive.z." in said
    assert f"{before!r} and {float(run.drive[1234, 2])!r} V; 1 rows, at most 0.111 fV" in said
    assert "round_trip" not in said
    assert main([str(one), "--compare", str(made(tmp_path / "short.mcap", Run(TICKS), without=slice(2000, 2500)))]) == 1
    assert "first tick that differs is 2000" in capsys.readouterr().out


def test_table_has_a_row_for_each_recording_of_a_folder_sorted_and_as_csv(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = Run(1000)
    for name in ("b", "a"):
        (tmp_path / name).mkdir()
        made(tmp_path / name / "run.mcap", Run(2000) if name == "a" else run)
    broken = tmp_path / "c.mcap"
    content = bytearray(made(tmp_path / "c0.mcap", run).read_bytes())
    content[len(content) // 2] ^= 1
    broken.write_bytes(content)
    (tmp_path / "c0.mcap").unlink()
    assert len(recordings([str(tmp_path), str(tmp_path / "*" / "run.mcap")])) == 3
    assert main([str(tmp_path), "--table", "--sort", "ticks", "--csv", str(tmp_path / "all.csv")]) == 1
    with open(tmp_path / "all.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [each["ticks"] for each in rows] == ["1000", "2000", ""]
    assert [float(each["rms_x"]) for each in rows[:2]] == [3.3177e-11] * 2
    assert "is damaged" in rows[2]["problem"]
    assert f"{broken} is damaged" in capsys.readouterr().out


def test_table_leaves_columns_out_and_says_so_before_it_cuts_a_number(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    made(tmp_path / "run.mcap")
    monkeypatch.setattr(inspect_command, "Console", lambda **_: Console(width=220, highlight=False))
    assert main([str(tmp_path), "--table"]) == 0
    wide = capsys.readouterr().out
    assert "no room" not in wide and "…" not in wide and "33.18 pm" in wide
    monkeypatch.setattr(inspect_command, "Console", lambda **_: Console(width=104, highlight=False))
    assert main([str(tmp_path), "--table"]) == 0
    narrow = capsys.readouterr().out
    assert "no room for" in narrow and ": --csv FILE has all" in narrow
    assert "…" not in narrow and "33.18 pm" in narrow


def test_killed_and_repaired_recording_is_told_as_such(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    left = made(tmp_path / "run.mcap", close=False)
    assert main([str(left)]) == 0
    assert "NOT COMPLETE: it has no end" in capsys.readouterr().out
    for question in (["--signal", "drive.x"], ["--psd", "drive.x"], ["--compare", str(left)]):
        assert main([str(left), *question]) == 0
        assert f"warning: {left} is not complete: it has no end" in capsys.readouterr().err
    repair(left, tmp_path / "repaired.mcap")
    assert main([str(tmp_path / "repaired.mcap")]) == 0
    said = capsys.readouterr().out
    assert "NOT COMPLETE: it has no end" in said
    assert "4000 ticks" in said
    assert main([str(tmp_path / "repaired.mcap"), "--compare", str(made(tmp_path / "whole.mcap"))]) == 0


@pytest.mark.filterwarnings("ignore::afm_recorder_node.recording.IncompleteRecording")
def test_no_spoiled_recording_gives_other_numbers_without_a_word(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = made(tmp_path / "run.mcap").read_bytes()
    whole = {name: each for name, each in row(tmp_path / "run.mcap").items() if name != "recording"}
    path, rng, told = tmp_path / "spoiled.mcap", random.Random(2), 0
    for k in range(200):
        changed = bytearray(content)
        if k % 4:
            changed[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
        else:
            del changed[rng.randrange(len(content)) :]
        path.write_bytes(changed)
        found = row(path)
        told += bool(found["problem"])
        if not found["problem"]:
            assert {name: each for name, each in found.items() if name != "recording"} == whole
    assert told > 190
    path.write_bytes(
        content[: len(content) // 2] + bytes([content[len(content) // 2] ^ 1]) + content[len(content) // 2 + 1 :]
    )
    for question in (
        [],
        ["--signal", "drive"],
        ["--psd", "deflection"],
        ["--loop"],
        ["--compare", str(tmp_path / "run.mcap")],
    ):
        assert main([str(path), *question]) == 2
        assert "damaged" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--plot", "a.png"], "--plot is an option of --signal or --psd or --loop"),
        (["--table", "--from", "0.1"], "--from is an option of --signal or --psd or --loop"),
        (["--compare", "b.mcap", "--csv", "a.csv"], "--csv is an option of --signal or --psd or --loop or --table"),
        (["--signal", "drive", "--axis", "y"], "--axis is an option of --psd or --loop"),
        (["--psd", "drive", "--sort", "ticks"], "--sort is an option of --table"),
        (["--loop", "--axis", "z"], "--loop needs --axis x or y"),
        (["--signal", "drive", "--plot", "a.txt"], "--plot a.txt: the name of a picture ends in .png, .svg, .pdf"),
    ],
)
def test_option_that_would_be_passed_over_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], told: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(tmp_path / "a.mcap"), *options])
    assert ended.value.code == 2
    assert told in capsys.readouterr().err


def test_points_of_a_loop_are_written_in_the_format_that_was_asked_for(tmp_path: Path) -> None:
    run = Run(TICKS)
    run.position[:, 0] = 5e-9 * np.sin(np.arange(TICKS) * 2.0 * np.pi * 4.0 / TICKS)
    asked = ["--loop", "--parquet", str(tmp_path / "loop.dat"), "--csv", str(tmp_path / "loop.txt")]
    assert main([str(made(tmp_path / "run.mcap", run)), *asked]) == 0
    table = pq.read_table(tmp_path / "loop.dat")
    assert table.column_names == ["position.x_m", "lateral_force_N"]
    np.testing.assert_allclose(table["position.x_m"], run.position[: len(table), 0], rtol=1e-15, atol=1e-30)
    with (tmp_path / "loop.txt").open() as file:
        assert [float(row["lateral_force_N"]) for row in csv.DictReader(file)] == table["lateral_force_N"].to_pylist()


def test_screen_needs_none_of_the_libraries_that_only_studies_need(tmp_path: Path) -> None:
    path = made(tmp_path / "run.mcap")
    record(tmp_path / "scan.mcap", [*Run(300).messages(), *map(line_message, lines_of())])
    asked = (
        "import sys; from afm_recorder_node.inspect_command import main; main(sys.argv[1:]); "
        "sys.exit(' '.join({'pandas', 'xarray', 'scipy.signal', 'matplotlib'} & sys.modules.keys()) or None)"
    )
    done = subprocess.run([sys.executable, "-c", asked, path, tmp_path / "scan.mcap"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "24 x 40 pixels" in done.stdout
