"""Odd questions, names and disks are answered in a sentence, before any work is done for them."""

import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from recorded import Run, event, record
from support import executable

from afm_bringup import compare_command, identify_command, score_command
from afm_recorder_node import inspect_command


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    messages = [event(0.0, "RUNNING\x1b[31m\nall is well"), *Run(300).messages(300)]
    return record(tmp_path / "run.mcap", messages)


@contextmanager
def small_files(size: int) -> Iterator[None]:
    """As on a disk that is full."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.mark.parametrize(
    ("question", "told"),
    [
        (["--signal", "drive", "--from", "nan"], "argument --from: nan s is not allowed: it must be a number"),
        (["--loop", "--to", "nan"], "argument --to: nan s is not allowed"),
        (["--loop", "--to", "0"], "no rows from -inf s to 0 s"),
        (["--loop", "--to", "2e-6"], "no friction loop along x"),
        (["--loop", "--from", "1e9"], "no rows from 1e+09 s to inf s"),
        (["--psd", "drive", "--to", "0"], "have no spectrum"),
        (["--psd", "drive", "--from", "1e300"], "have no spectrum"),
        (["--signal", "drive", "--from", "1", "--to", "0"], "--from 1 s is not allowed with --to 0 s"),
        (["--signal", "drive", "--csv", "/proc/none/x.csv"], "/proc/none/x.csv cannot be written: No such file"),
        (["--signal", "drive", "--csv", "/tmp"], "/tmp cannot be written: it is a folder"),
    ],
)
def test_odd_questions_are_answered_in_a_sentence(
    question: list[str], told: str, recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = inspect_command.main([str(recording), *question])
    except SystemExit as refused:  # of argparse
        code = int(str(refused.code))
    said = capsys.readouterr().err
    assert code == 2 and told in said and "Traceback" not in said, said


@pytest.mark.parametrize("command", ["compare", "compare --robust", "identify", "scorecard"])
def test_where_results_cannot_be_written_it_is_said_before_the_work(
    command: str, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def work(*_: object, **__: object) -> None:
        pytest.fail("it has begun to work")

    place = str(recording / "below")  # below a file
    monkeypatch.setattr(compare_command, "compare", work)
    monkeypatch.setattr(compare_command, "_robust", work)
    monkeypatch.setattr(score_command, "_score", work)
    monkeypatch.setattr(identify_command, "read_recording", work)
    name, *more = command.split()
    source = {"compare": ["pid"], "scorecard": ["closed_loop_tanh"]}.get(name, [str(recording)])
    monkeypatch.setattr(sys, "argv", [name, *source, *more, "--out", place])
    module = {"compare": compare_command, "scorecard": score_command, "identify": identify_command}
    assert module[name].main() == 1
    assert capsys.readouterr().err == f"error: {place} cannot be written: Not a directory\n"


def test_a_name_that_is_no_text_is_printed_with_escapes(recording: Path) -> None:
    odd = os.fsencode(recording.parent) + b"/\xff\x1b[31m.mcap"
    os.rename(recording, odd)
    for package, command, more in (
        ("afm_recorder_node", "inspect", ["--table"]),
        ("afm_bringup", "check_scenario", []),
    ):
        done = subprocess.run([executable(package, command), odd, *more], capture_output=True, check=False)
        said = done.stdout + done.stderr
        assert b"Traceback" not in said and b"\x1b[31m" not in said and b"\\udcff" in said, said


@pytest.mark.parametrize("option", ["--csv", "--parquet"])
def test_a_full_disk_is_named_where_an_answer_does_not_fit(
    option: str, recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with small_files(100):
        assert inspect_command.main([str(recording), "--signal", "drive", option, str(tmp_path / "answer")]) == 2
    told = capsys.readouterr().err
    assert f"{tmp_path / 'answer'} cannot be written: " in told and "File too large" in told


def test_text_in_a_recording_is_no_command_to_the_terminal(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert inspect_command.main([str(recording)]) == 0
    said = capsys.readouterr().out
    assert "\x1b" not in said and "RUNNING\\x1b[31m\\nall is well" in said
