"""The scanner is identified over topics, and the controller loads what was found."""

import sys
from pathlib import Path

import pytest
import yaml
from support import assert_nothing_left, session

from afm_bringup.identify_command import main

OVERRIDES = {
    "/**/afm_sim_node": {"ros__parameters": {"scanner": {"f_x": 612.3}, "detector": {"position_noise": 5e-11}}},
}


@pytest.mark.long
def test_shaken_scanner_is_identified_and_its_parameters_are_loaded_and_a_recording_in_contact_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def identify(*arguments: object) -> int:
        monkeypatch.setattr(sys, "argv", ["identify", *map(str, arguments)])
        return main()

    (tmp_path / "other.yaml").write_text(yaml.safe_dump(OVERRIDES))
    with session(
        "identify_scanner", tmp_path / "out", "--composed", "--overrides", str(tmp_path / "other.yaml"), folder=tmp_path
    ) as command:
        assert command.wait() == 0, command.text
    code = identify(tmp_path / "out" / "recording.rrd", "--out", tmp_path / "scanner.yaml")
    told = capsys.readouterr()
    assert code == 0, told.err
    assert "612." in told.out
    found = yaml.safe_load((tmp_path / "scanner.yaml").read_text())["/**/afm_controller_node"]["ros__parameters"]
    assert found["scanner"]["f_x"] == pytest.approx(612.3, rel=1e-3)
    assert found["scanner"]["f_y"] == pytest.approx(407.07, rel=1e-3)
    # As overrides of another session, short and in contact: the controller takes them.
    content = yaml.safe_load((tmp_path / "scanner.yaml").read_text())
    content["/**/afm_sim_node"] = {"ros__parameters": {"run": {"duration": 0.005}, "plant": {"gap": 0.0}}}
    (tmp_path / "both.yaml").write_text(yaml.safe_dump(content))
    with session(
        "identify_scanner", tmp_path / "next", "--composed", "--overrides", str(tmp_path / "both.yaml"), folder=tmp_path
    ) as command:
        assert command.wait() == 0, command.text
    assert_nothing_left()
    # In contact the scanner is held by friction and follows no chirp.
    assert identify(tmp_path / "next" / "recording.rrd") == 1
    assert "along x: an axis that is not driven, or does not move" in capsys.readouterr().err
    assert identify(tmp_path / "none.rrd") == 1
