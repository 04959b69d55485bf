"""Claims about docs/verbs.md: its example in Python prints what the page says."""

import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "verbs.md").read_text()


def test_the_example_of_the_page_prints_what_the_page_says(capsys):
    pytest.importorskip("xarray")
    (program,) = re.findall(r"<!-- python -->\n```python\n(.*?)```\n<!-- end -->", PAGE, re.DOTALL)
    exec(compile(program, "verbs", "exec"), {})
    printed = re.findall(r"([\d.]+) nN", capsys.readouterr().out)
    assert f"It prints {printed[0]} nN and {printed[1]} nN" in PAGE


def test_the_example_of_calibrations_in_use_prints_what_the_page_says(capsys):
    pytest.importorskip("xarray")
    (program,) = re.findall(r"<!-- calibrations -->\n```python\n(.*?)```\n<!-- end -->", PAGE, re.DOTALL)
    exec(compile(program, "calibrations", "exec"), {})
    printed = capsys.readouterr().out.strip()
    assert f"It prints {printed}" in PAGE
    k, uncertainty = (float(each) for each in re.findall(r"[\d.]+", printed)[:2])
    assert abs(k - 0.2) < 2.0 * uncertainty < 0.04
