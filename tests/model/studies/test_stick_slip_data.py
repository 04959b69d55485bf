"""The data set of exact stick-slip: its truth against an integration of its own, and the package that loads it."""

import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pypi import installed
from scipy.io import loadmat
from scipy.linalg import expm
from scipy.optimize import brentq

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("stick_slip")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["stick_slip_data.py", "--out", str(made)])
        runpy.run_path(str(ROOT / "examples" / "stick_slip_data.py"), run_name="__main__")
    return made


def _read(folder: Path, name: str) -> dict[str, Any]:
    found = loadmat(folder / "EMPS" / f"{name}.mat")
    return {key: each[:, 0] for key, each in found.items() if not key.startswith("__")}


@pytest.fixture(params=["DATA_EMPS", "DATA_EMPS_PULSES"])
def file(folder: Path, request: pytest.FixtureRequest) -> dict[str, Any]:
    return _read(folder, request.param)


def integrated(file: dict[str, Any]) -> np.ndarray:
    """Places of m x'' + c x' + k x = u - friction: exact between the moments at which it stops."""
    (m,), (c,), (k,), bound = (file[name] for name in ("mass", "damping", "stiffness", "friction_bound"))
    period, x, v, places = file["t"][1] - file["t"][0], 0.0, 0.0, []

    def moved(x: float, v: float, force: float, time: float) -> Any:
        rest = force / k
        return expm(np.array([[0.0, 1.0], [-k / m, -c / m]]) * time) @ [x - rest, v] + [rest, 0.0]

    for force, most in zip(file["vir"], bound, strict=True):
        places.append(x)
        left = period
        while left > 0.0:
            pull = force - k * x
            if v == 0.0 and abs(pull) <= most:
                break
            sign = np.sign(v) if v else np.sign(pull)
            net = force - sign * most
            _, later = moved(x, v, net, left)
            if sign * later >= 0.0:
                x, v = moved(x, v, net, left)
                break
            first = 1e-6 * left if v == 0.0 else 0.0
            stop = brentq(lambda time: moved(x, v, net, time)[1], first, left, xtol=1e-15)  # noqa: B023
            (x, _), v, left = moved(x, v, net, stop), 0.0, left - stop
    return np.array(places)


def test_truth_of_the_data_set_is_that_of_an_integration_of_its_equation(file: dict[str, Any]) -> None:
    assert np.abs(file["x"] - integrated(file)).max() < 1e-3 * np.ptp(file["x"])
    stuck = file["stuck"] > 0.0
    assert 0.2 < stuck.mean() < 0.9 and np.count_nonzero(np.diff(stuck)) > 20
    # At rest to the last bit, and friction is what the spring leaves of the force; else it is at its bound.
    assert not file["v"][stuck].any()
    still = stuck[1:] & stuck[:-1]
    holding = (file["vir"][:-1] - file["stiffness"] * file["x"][1:])[still]
    np.testing.assert_allclose(file["friction"][1:][still], holding, rtol=0.0, atol=1e-12 * file["friction_bound"][0])
    np.testing.assert_allclose(np.abs(file["friction"][~stuck]), file["friction_bound"][~stuck], rtol=1e-12)


def test_measured_position_is_the_true_one_with_the_noise_of_the_sensor(file: dict[str, Any]) -> None:
    assert (file["qm"] - file["x"]).std() == pytest.approx(10e-12, rel=0.05)


@pytest.mark.long
def test_nonlinear_benchmarks_loads_the_data_set(folder: Path, tmp_path: Path) -> None:
    """The package as it is; it needs progressbar and requests for downloads alone."""
    packages = installed(tmp_path, "nonlinear-benchmarks==1.0.1", "progressbar==2.5", "requests", "urllib3", "idna")
    installed(tmp_path, "certifi", "charset-normalizer", "tqdm")
    program = (
        "import sys, numpy, nonlinear_benchmarks; train, test = nonlinear_benchmarks.EMPS(dir_placement=sys.argv[1]);"
        "numpy.savez(sys.argv[2], t=train.sampling_time, u=train.u, y=train.y, v=test.u, z=test.y)"
    )
    command = [sys.executable, "-c", program, folder, tmp_path / "loaded.npz"]
    done = subprocess.run(command, env={"PYTHONPATH": packages}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "loaded.npz") as loaded:
        assert float(loaded["t"]) == 50e-6
        for name, u, y in (("DATA_EMPS", "u", "y"), ("DATA_EMPS_PULSES", "v", "z")):
            file = _read(folder, name)
            np.testing.assert_array_equal(loaded[u], file["vir"])
            np.testing.assert_array_equal(loaded[y], file["qm"])
