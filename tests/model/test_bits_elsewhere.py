"""The bits are those of other processors too: run with what this one has switched off."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

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
SOME = ["closed_loop_tanh", "lever, dmt, three modes, heat", "sample rough", "real time, late and lost"]
"""Law and contact; modes and random numbers; Fourier transform and splines; latencies."""


def differing(names: list[str]) -> list[str]:
    run = subprocess.run(
        [sys.executable, str(BITS), *names], env={**os.environ, **PLAIN}, capture_output=True, text=True, timeout=3000
    )
    return told_to_differ(run)


def told_to_differ(run: subprocess.CompletedProcess[str]) -> list[str]:
    assert "compositions" in run.stdout, run.stderr
    return [name for line in run.stdout.splitlines() if (name := line.rpartition(": ")[0]) in bits.NAMES]


@pytest.mark.skipif(sys.platform != "linux" or os.uname().machine != "x86_64", reason="these switches are of x86-64")
def test_bits_are_the_same_without_fma_and_avx() -> None:
    assert differing(SOME) == []


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux" or os.uname().machine != "x86_64", reason="these switches are of x86-64")
def test_all_bits_but_those_of_fits_are_the_same_without_fma_and_avx() -> None:
    assert [name for name in differing([]) if name not in bits.FITTED] == []


@pytest.mark.long
@pytest.mark.skipif(not shutil.which("qemu-aarch64") or not shutil.which("apt-get"), reason="needs qemu-user of Debian")
def test_bits_are_the_same_on_arm64() -> None:
    run = subprocess.run(
        [str(BITS.with_name("arm64.sh")), "open_loop", *SOME], capture_output=True, text=True, timeout=5000
    )
    assert told_to_differ(run) == []
