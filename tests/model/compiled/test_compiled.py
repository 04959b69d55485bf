"""Claims about the room of compiled code: no other imports numba, and this one was tried with the numba that runs."""

import re
from importlib.metadata import version
from pathlib import Path

import pytest

from afm_model.compiled import TRIED

ROOT = Path(__file__).resolve().parents[3]
IMPORT = re.compile(r"^\s*(?:from|import) (?:numba|llvmlite)\b", re.MULTILINE)


def number(text: str) -> tuple[int, ...]:
    return tuple(int(each) for each in re.findall(r"\d+", text)[:3])


def test_no_other_room_imports_numba_or_llvmlite():
    files = sorted(ROOT.glob("afm_*/afm_*/**/*.py"))
    inside, outside = [], []
    for file in files:
        if IMPORT.search(file.read_text()):
            (inside if file.parent.name == "compiled" else outside).append(file.name)
    assert len(files) > 400 and "jit.py" in inside
    assert outside == []


@pytest.mark.parametrize("package", TRIED)
def test_the_version_that_is_installed_was_tried(package):
    oldest, newest = TRIED[package]
    assert number(oldest) <= number(version(package)) <= number(newest)


def test_the_oldest_version_tried_is_the_oldest_that_can_be_installed():
    allowed = re.search(r"numba>=([\d.]+)", (ROOT / "afm_model" / "setup.py").read_text())
    assert allowed and number(TRIED["numba"][0])[:2] == number(allowed[1])
