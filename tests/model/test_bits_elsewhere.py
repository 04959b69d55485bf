"""The bits are those of other processors and other versions of packages too: the same runs with them."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import bits
import pytest

BITS = Path(bits.__file__)
PLAIN = {
    # The C library without its ways for newer processors, then numpy, BLAS and numba.
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX,-AVX2,-AVX512F",
    "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX",
    "OPENBLAS_CORETYPE": "Prescott",
    "NUMBA_CPU_NAME": "generic",
    "NUMBA_CPU_FEATURES": "",
}


def differing(command: list[Any], **environment: str) -> list[str]:
    """Lines of `make bits` that tell of a difference; the result of a fit may differ, no trajectory may."""
    found = subprocess.run(
        list(map(str, command)), env={**os.environ, **environment}, capture_output=True, text=True, timeout=5000
    )
    assert re.search("^[0-9]+ compositions, ", found.stdout, re.MULTILINE), found.stderr
    lines = [(line.rpartition(": ")[0], line) for line in found.stdout.splitlines()]
    return [line for name, line in lines if name in bits.NAMES and (name not in bits.FITTED or "trajectory" in line)]


@pytest.mark.long
@pytest.mark.timeout(0)
@pytest.mark.skipif(sys.platform != "linux" or os.uname().machine != "x86_64", reason="these switches are of x86-64")
def test_all_bits_but_those_of_fits_are_the_same_without_fma_and_avx() -> None:
    assert differing([sys.executable, BITS], **PLAIN) == []


@pytest.mark.long
@pytest.mark.timeout(0)
@pytest.mark.skipif(not shutil.which("qemu-aarch64") or not shutil.which("apt-get"), reason="needs qemu-user of Debian")
def test_bits_are_the_same_on_arm64() -> None:
    assert differing([BITS.with_name("arm64.sh")]) == []


@pytest.mark.long
@pytest.mark.timeout(0)
@pytest.mark.parametrize("which", ["oldest", "newest"])
def test_bits_are_the_same_with_the_oldest_and_the_newest_packages_allowed(which: str, tmp_path: Path) -> None:
    """Installed as by a user, into an environment of its own; the oldest are the bounds of setup.py."""
    package, law = tmp_path / "afm_model", tmp_path / "afm_predictive"
    for each in (package, law):
        shutil.copytree(BITS.parents[1] / each.name, each, ignore=shutil.ignore_patterns("build", "__pycache__"))
    bounds = re.findall(r'"(\w+)>=([\d.]+)"', (package / "setup.py").read_text())
    assert {"numpy", "scipy", "numba"} <= {name for name, _ in bounds}
    oldest = tmp_path / "oldest.txt"
    oldest.write_text("".join(f"{name}=={version}\n" for name, version in bounds if which == "oldest"))
    python = tmp_path / "venv" / "bin" / "python"
    base: Any = sys
    subprocess.run([base._base_executable, "-m", "venv", python.parents[1]], check=True)
    subprocess.run([python, "-m", "pip", "install", "-q", "-c", oldest, f"{package}[files]", law], check=True)
    assert differing([python, BITS], PYTHONPATH="", NUMBA_CACHE_DIR=str(tmp_path / "kernels")) == []
