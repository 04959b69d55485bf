"""Claims about docs/verbs.md: its example in Python prints what the page says."""

import re
from pathlib import Path

import pytest
from printed.page_run import run_programs

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "verbs.md").read_text()


def test_the_example_of_the_page_prints_what_the_page_says(tmp_path):
    pytest.importorskip("xarray")
    done = run_programs("docs/verbs.md", tmp_path, "python")
    printed = re.findall(r"([\d.]+) nN", done.printed["python"])
    assert f"It prints {printed[0]} nN and {printed[1]} nN" in PAGE


def test_the_example_of_a_z_that_is_held_runs(tmp_path):
    pytest.importorskip("xarray")
    microscope = run_programs("docs/verbs.md", tmp_path, "held").scope["microscope"]
    assert not microscope.state.near


def test_the_example_of_calibrations_in_use_prints_what_the_page_says(tmp_path):
    pytest.importorskip("xarray")
    printed = run_programs("docs/verbs.md", tmp_path, "calibrations").printed["calibrations"].strip()
    assert f"It prints {printed}" in PAGE
    k, uncertainty = (float(each) for each in re.findall(r"[\d.]+", printed)[:2])
    assert abs(k - 0.2) < 2.0 * uncertainty < 0.04
