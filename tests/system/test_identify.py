"""The scanner is identified over topics, and the controller loads what was found."""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from support import assert_nothing_left, session

OVERRIDES = {
    "/**/afm_sim_node": {"ros__parameters": {"scanner": {"f_x": 612.3}, "detector": {"position_noise": 5e-11}}},
}


def identify(*arguments: object, folder: Path) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-c", "import sys; from afm_bringup.__main__ import identify; sys.exit(identify())"]
    return subprocess.run(
        [*command, *map(str, arguments)], cwd=folder, capture_output=True, text=True, timeout=120, check=False
    )


def test_shaken_scanner_is_identified_and_its_parameters_are_loaded(tmp_path: Path) -> None:
    (tmp_path / "other.yaml").write_text(yaml.safe_dump(OVERRIDES))
    with session(
        "identify_scanner", tmp_path / "out", "--overrides", str(tmp_path / "other.yaml"), folder=tmp_path
    ) as command:
        assert command.wait() == 0, command.text
    done = identify(tmp_path / "out" / "recording.rrd", "--out", "scanner.yaml", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "612." in done.stdout
    found = yaml.safe_load((tmp_path / "scanner.yaml").read_text())["/**/afm_controller_node"]["ros__parameters"]
    assert found["scanner"]["f_x"] == pytest.approx(612.3, rel=1e-3)
    assert found["scanner"]["f_y"] == pytest.approx(407.07, rel=1e-3)
    # As overrides of another session, short: the controller takes them.
    content = yaml.safe_load((tmp_path / "scanner.yaml").read_text())
    content["/**/afm_sim_node"] = {"ros__parameters": {"run": {"duration": 0.001}, "score": {"start": 0.0}}}
    (tmp_path / "both.yaml").write_text(yaml.safe_dump(content))
    with session(
        "closed_loop_tanh", tmp_path / "next", "--overrides", str(tmp_path / "both.yaml"), folder=tmp_path
    ) as command:
        assert command.wait() == 0, command.text
    assert_nothing_left()


def test_recording_in_contact_is_no_identification(tmp_path: Path) -> None:
    content = {
        "/**/afm_sim_node": {"ros__parameters": {"plant": {"gap": 0.0}, "run": {"duration": 0.05}}},
    }
    (tmp_path / "contact.yaml").write_text(yaml.safe_dump(content))
    with session(
        "identify_scanner", tmp_path / "out", "--overrides", str(tmp_path / "contact.yaml"), folder=tmp_path
    ) as command:
        assert command.wait() == 0, command.text
    done = identify(tmp_path / "out" / "recording.rrd", folder=tmp_path)
    assert done.returncode == 1
    assert "along x: an axis that is not driven, or does not move" in done.stderr
    assert identify(tmp_path / "none.rrd", folder=tmp_path).returncode == 1
