"""Claims about clients from PyPI, unchanged: nanonisTCP, nanonis_spm, nspmctl."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from .conftest import Served
from .programs import programs, run

EXAMPLES = ["BiasSpectroscopy", "ForceDistanceCurve_OffsetComp", "SwitchMode_STM_AFM"]
LONG = [
    *("AutoApproach", "BiasPulsesAtVariousZ", "BiasSpectroscopy_MultiSegment", "CustomBiasSweep", "CustomZSweep"),
    *("LockInSweep", "RFGen_FreqSweep", "TipCleaner", "TipShaper"),
]
MODULES = 18
_KEYBOARD = "def is_pressed(key):\n    return False\n"
"""In place of a package that needs root."""


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = programs(tmp_path_factory.mktemp("clients"), "nanonisTCP==1.1.5", "nanonis_spm==1.0.9", "nspmctl==0.3.0")
    (folder / "keyboard.py").write_text(_KEYBOARD)
    return folder


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    made = Served(tmp_path_factory.mktemp("session"), factor=1.0)
    yield made
    made.close()


def test_suite_of_nanonistcp_passes_in_all_its_modules(packages: Path, served: Served) -> None:
    printed = run(served, packages, packages / "nanonisTCP" / "test" / "test.py")
    assert printed.splitlines().count("success") == MODULES, printed
    assert "failed" not in printed


@pytest.mark.parametrize("name", [*EXAMPLES, *(pytest.param(name, marks=pytest.mark.long) for name in LONG)])
def test_example_of_nanonis_spm_runs(packages: Path, served: Served, name: str) -> None:
    run(served, packages, packages / "nanonis_spm_examples" / f"Example_{name}.py")
    with served.client() as client:
        # The instrument goes on, and answers.
        assert len(client.call("Signals.NamesGet", returns="SA")[0]) == 128


def nspmctl(served: Served, packages: Path, *words: str) -> Any:
    return json.loads(run(served, packages, "-m", "nspmctl", *words))


def test_nspmctl_finds_the_ports_and_what_it_can_do(packages: Path, served: Served) -> None:
    probed = nspmctl(served, packages, "doctor", "--command-probe")["probe"]
    assert probed["candidate_ports"] == [6501, 6502, 6503, 6504]
    assert nspmctl(served, packages, "capabilities")["parameters"]["count"] == 330


@pytest.mark.long
def test_nspmctl_sets_and_gets_parameters(packages: Path, served: Served) -> None:
    nspmctl(served, packages, "set", "bias_v", "0.5")
    assert nspmctl(served, packages, "get", "bias_v")["value"] == 0.5
    setpoint = nspmctl(served, packages, "get", "zctrl_setpoint_a")["value"]
    assert setpoint == pytest.approx(served.microscope.state.setpoint, rel=1e-6)
