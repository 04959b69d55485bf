"""Claims about clients from PyPI, unchanged: the suite of nanonisTCP, examples of nanonis_spm."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from .conftest import Served

PACKAGES = ["nanonisTCP==1.1.5", "nanonis_spm==1.0.9"]
EXAMPLES = [
    *("AutoApproach", "BiasPulsesAtVariousZ", "BiasSpectroscopy", "BiasSpectroscopy_MultiSegment", "CustomBiasSweep"),
    *("CustomZSweep", "ForceDistanceCurve_OffsetComp", "LockInSweep", "RFGen_FreqSweep", "SwitchMode_STM_AFM"),
    *("TipCleaner", "TipShaper"),
]
MODULES = 18
_LAUNCH = """
import os, runpy, socket, sys
free = dict(zip((6501, 6502, 6503, 6504), map(int, os.environ["PORTS"].split(","))))
connect = socket.socket.connect
socket.socket.connect = lambda self, place: connect(self, (place[0], free.get(place[1], place[1])))
sys.path.insert(0, os.path.dirname(sys.argv[1]))
runpy.run_path(sys.argv[1], run_name="__main__")
"""
"""Runs a program whose ports are those that were free; nothing of it is changed."""
_KEYBOARD = "def is_pressed(key):\n    return False\n"
"""In place of a package that needs root."""


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clients")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    done = subprocess.run([*command, "--target", folder, *PACKAGES], capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"PyPI cannot be reached: {done.stderr[-300:]}")
    (folder / "keyboard.py").write_text(_KEYBOARD)
    (folder / "launch.py").write_text(_LAUNCH)
    return folder


def run(served: Served, packages: Path, program: Path) -> str:
    """Output of a program."""
    environment = os.environ | {"PYTHONPATH": str(packages), "MPLBACKEND": "Agg"}
    environment["PORTS"] = ",".join(map(str, served.server.ports))
    done = subprocess.run(
        [sys.executable, packages / "launch.py", program],
        env=environment,
        cwd=served.front.folder,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    made = Served(tmp_path_factory.mktemp("session"), factor=1.0)
    yield made
    made.close()


def test_suite_of_nanonistcp_passes_in_all_its_modules(packages: Path, served: Served) -> None:
    printed = run(served, packages, packages / "nanonisTCP" / "test" / "test.py")
    assert printed.splitlines().count("success") == MODULES, printed
    assert "failed" not in printed


@pytest.mark.parametrize("name", EXAMPLES)
def test_example_of_nanonis_spm_runs(packages: Path, served: Served, name: str) -> None:
    run(served, packages, packages / "nanonis_spm_examples" / f"Example_{name}.py")
    with served.client() as client:
        # The instrument goes on, and answers.
        assert len(client.call("Signals.NamesGet", returns="SA")[0]) == 128
