"""Claim about afspm, which operates microscopes of several makers: its suite passes, run as its users run it."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from .conftest import Served
from .programs import places, redirect
from .test_physics import NOISE, SOME, by_verbs

ADDRESS, COMMIT = "https://github.com/grutter-spm-group/afspm", "58d86686f5c00c52e8c6bec2f654757b9fbd18c6"
PACKAGES = [
    *("pyzmq<26", "protobuf<6", "grpcio-tools<1.72", "numpy<2", "pint<0.23", "fire<0.8", "tomli", "xarray<2026"),
    *("imageio", "colorlog", "graphviz<0.21", "netcdf4", "scikit-image<0.26", "scikit-learn", "scipy", "matplotlib"),
    *("scifireaders<0.12", "ipython<9", "pytest<8"),
]
TESTS = 11
_MODE = "afspm.components.microscope.translators.nanonis.message.spectroscopy.SpectroscopyMode"
_OF_CURRENTS, _WIDE = "range = [10e-13, 10e-9]", "range = [-10, 10]"
"""Setpoint and gains in its configuration, and as its users set them for a deflection."""


def done(*command: Path | str, **options: object) -> None:
    """Run a command of the installation, or skip the test where it does not succeed: there may be no network."""
    ran = subprocess.run(list(command), capture_output=True, text=True, check=False, **options)  # type: ignore[call-overload]
    if ran.returncode:
        pytest.skip(f"afspm cannot be installed: {ran.stderr[-300:]}")


@pytest.fixture(scope="module")
def afspm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with afspm, and `bin/python` with what it needs: other versions than those of the tests."""
    folder = tmp_path_factory.mktemp("afspm")
    done("git", "clone", "--quiet", ADDRESS, folder / "code")
    done("git", "-C", folder / "code", "checkout", "--quiet", COMMIT)
    done(sys.executable, "-m", "venv", folder)
    done(folder / "bin" / "pip", "install", "--quiet", *PACKAGES)
    protos = folder / "code" / "afspm" / "io" / "protos"
    compiler = [folder / "bin" / "python", "-m", "grpc_tools.protoc", "--experimental_editions"]
    where = [f"--proto_path={protos / 'src'}", f"--python_out={protos / 'generated'}"]
    done(*compiler, *where, *(protos / "src").glob("*.proto"))
    ranges = folder / "code/afspm/components/microscope/translators/nanonis/params.toml"
    assert ranges.read_text().count(_OF_CURRENTS) == 3
    ranges.write_text(ranges.read_text().replace(_OF_CURRENTS, _WIDE))
    redirect(folder)
    return folder


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    made = Served(tmp_path, factor=1.0)
    with made.client() as client:
        # Scans and spectra of some seconds: it cancels some of them.
        client.call("FolMe.SpeedSet", "f I", 2e-5, 1)
        client.call("Scan.SpeedSet", "f f f f H f", 0.0, 0.0, 0.05, 0.05, 2, 1.0)
        client.call("BiasSpectr.TimingSet", "f f f f f f", 0.0, 0.0, 0.1, 1.0, 0.01, 0.01)
    yield made
    made.close()


@contextmanager
def components(afspm: Path, config: Path, environment: dict[str, str], log: Path) -> Iterator[None]:
    """Its processes between client and microscope, from when they are ready."""
    command = [afspm / "bin" / "python", "-m", "afspm.spawn", "spawn_components", config]
    with log.open("w") as told:
        place = {"cwd": log.parent, "start_new_session": True}
        running = subprocess.Popen(command, env=environment, stdout=told, stderr=told, **place)
    try:
        while "New scope state SS_FREE" not in log.read_text():
            with suppress(subprocess.TimeoutExpired):
                running.wait(0.2)
                pytest.fail(log.read_text())
        yield
    finally:
        os.killpg(running.pid, 15)
        running.wait()


@pytest.mark.long
def test_suite_of_afspm_passes(afspm: Path, served: Served, tmp_path: Path) -> None:
    code = afspm / "code"
    suite = code / "tests" / "components" / "microscope" / "translators"
    config = suite / "nanonis" / "config.toml"
    environment = places(served, afspm, code, code / "afspm" / "io" / "protos" / "generated")
    with components(afspm, config, environment, tmp_path / "components.log"):
        command = [afspm / "bin" / "python", "-m", "pytest", suite / "test_translator.py", "--config_path", config]
        ran = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert f"{TESTS} passed" in ran.stdout, ran.stdout[-4000:] + (tmp_path / "components.log").read_text()[-4000:]


@pytest.mark.long
def test_experiment_by_afspm_has_the_numbers_of_the_verbs(afspm: Path, tmp_path: Path) -> None:
    code = afspm / "code"
    suite = (code / "tests/components/microscope/translators/nanonis/config.toml").read_text()
    config = tmp_path / "config.toml"
    config.write_text(f"{suite}mode = 'mode'\n[mode]\nclass = '{_MODE}'\nvalue = 2\n")
    made = Served(tmp_path, factor=1.0, **NOISE)
    with made.client() as operator:  # What its users set in the windows of the vendor's program.
        vertical, horizontal, z = 1, 2, 30
        operator.call("Scan.BufferSet", "*i i i", [vertical, horizontal], 64, 64)
        operator.call("ZSpectr.ChsSet", "*i", [z, vertical])
        operator.call("ZSpectr.RangeSet", "f f", 150e-9, -400e-9)
        operator.call("ZSpectr.PropsSet", "H i H H H H", 1, 4000, 1, 1, 2, 1)
        operator.call("ZSpectr.TimingSet", "f f f f f f f", 0.0, 2e-3, 1.0, 0.0, 1e-4, 0.0, 0.0)
        operator.call("ZSpectr.RetractSet", "H f i H", 1, 6.0, vertical, 0)
    environment = places(made, afspm, code, code / "afspm" / "io" / "protos" / "generated")
    log = tmp_path / "components.log"
    with components(afspm, config, environment, log):
        command = [afspm / "bin" / "python", Path(__file__).with_name("afspm_two_materials.py")]
        ran = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)
    made.close()
    assert ran.returncode == 0, ran.stderr[-2000:] + log.read_text()[-4000:]
    found, wanted = json.loads(ran.stdout.splitlines()[-1]), by_verbs()
    for side, numbers in wanted.items():
        for name, (value, error) in numbers.items():
            other, other_error = found[side][name]
            assert abs(value - other) < SOME * math.hypot(error, other_error), (side, name, value, other)
