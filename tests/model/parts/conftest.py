"""A package of parts outside this tree, as somebody else writes and installs it."""

import importlib
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from afm_model.core import registry

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "parts"
IN_PYTHON = """
import dataclasses
from own_parts import bursts, creep, kalman, patches

def plain(part, **functions):
    return dataclasses.replace(part, **{name: function.py_func for name, function in functions.items()})

KALMAN = plain(kalman.KALMAN, control=kalman.control)
PATCHES = plain(patches.PATCHES, surface=patches.surface)
CREEP = plain(creep.CREEP, actuate=creep.actuate)
BURSTS = plain(bursts.BURSTS, on_measurement=bursts.on_measurement, on_drive=bursts.on_drive)
"""
BROKEN = """
import dataclasses
from typing import Annotated
from afm_model.parts import kernel
from own_parts import kalman

def fails(t, y, u, p, s):
    raise LookupError("no such gain")

@kernel
def misspelt(t, y, u, p, s):
    u.voltage[0] = y.nothing_of_that_name

RAISES = dataclasses.replace(kalman.KALMAN, control=fails)
MISSPELT = dataclasses.replace(kalman.KALMAN, control=misspelt)
WRONG_CONSTANTS = dataclasses.replace(kalman.KALMAN, values=lambda parameters: {"period": 1.0})

class Scaled(kalman.Constants):
    jerk: Annotated[float, "x0/s^2"]

WRONG_UNIT = dataclasses.replace(kalman.KALMAN, constants=Scaled)
NO_PART = 3
"""


@pytest.fixture(scope="module")
def outside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder outside the tree with a package `own_parts`, installed with entry points as pip would install it."""
    folder = tmp_path_factory.mktemp("outside")
    shutil.copytree(EXAMPLES, folder / "own_parts")
    (folder / "own_parts" / "__init__.py").touch()
    (folder / "own_parts" / "in_python.py").write_text(IN_PYTHON)
    (folder / "own_parts" / "broken.py").write_text(BROKEN)
    metadata = folder / "own_parts-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: own_parts\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text("[afm_model.law]\nkalman = own_parts.kalman:KALMAN\n")
    return folder


@pytest.fixture
def own(outside: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The same, found by this process."""
    monkeypatch.syspath_prepend(str(outside))
    importlib.invalidate_caches()
    registry._offered.cache_clear()
    yield outside
    registry._offered.cache_clear()
