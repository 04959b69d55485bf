"""`make lint` finds elementary functions whose last bit depends on the machine, and leaves what is exact."""

import runpy
from pathlib import Path

import pytest

others = runpy.run_path(str(Path(__file__).parents[2] / "tools" / "check_elementary.py"))["others"]


@pytest.mark.parametrize(
    "line",
    [
        "math.exp(x)",
        "np.tan(x)",
        "x**2",
        "x ** (1.0 / 3.0)",
        "2.0**x",
        "a @ b",
        "np.linalg.solve(a, b)",
        "np.fft.fft(x)",
        "from scipy.linalg import expm",
        "from scipy.ndimage import zoom",
        "np.random.default_rng(1)",
    ],
)
def test_what_depends_on_the_machine_is_found(line: str) -> None:
    assert list(others(line))


@pytest.mark.parametrize(
    "line", ["2**bits", "math.sqrt(x)", "np.sqrt(x)", "exp(x)", "x * x", "from scipy.ndimage import grey_dilation"]
)
def test_what_is_exact_or_ours_is_left(line: str) -> None:
    assert not list(others(line))
