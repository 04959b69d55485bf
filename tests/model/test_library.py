"""Claims about afm_model as a library: docs/library.md, the plot, what is in the wheel."""

import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot
import numpy as np
import pytest
from printed.page_run import run_programs

from afm_model import ControllerParameters, ScenarioError, Simulation, build, load_scenario, scenario_names, simulate
from afm_model.parameters import SimParameters
from afm_model.run.plotting import envelope

ROOT = Path(__file__).resolve().parents[2]
NAMES = sorted(file.stem for file in (ROOT / "afm_model" / "afm_model" / "scenarios").glob("*.yaml"))


@pytest.fixture(scope="module", autouse=True)
def _no_display():
    before = matplotlib.get_backend()
    matplotlib.use("Agg")
    yield
    matplotlib.use(before)


@pytest.fixture(scope="module")
def done() -> Simulation:
    values = {"plant.control_period": 4e-6, "detector.position_noise": 1e-12, "run.duration": 4e-3, "score.start": 0.0}
    return simulate(build(SimParameters, values), ControllerParameters())


def test_examples_of_the_page_run_and_the_one_of_our_law_gives_its_trajectory(tmp_path):
    printed = run_programs("docs/library.md", tmp_path).printed
    assert list(printed) == ["scenario", "plot", "long", "ticks"]
    assert printed["scenario"].splitlines()[-1].startswith("2591fc59")
    assert (tmp_path / "closed_loop.png").stat().st_size > 20_000


def test_scenarios_that_come_with_the_package_are_loaded_by_name_and_a_file_counts_before_a_name(tmp_path, monkeypatch):
    assert scenario_names() == NAMES
    assert {"closed_loop_realtime", "closed_loop_sgn", "closed_loop_tanh", "open_loop"} <= set(NAMES)
    for name in NAMES:
        assert load_scenario(name).name == name
        assert load_scenario(name).header.title
    monkeypatch.chdir(tmp_path)
    (tmp_path / "open_loop").write_text("/**/afm_controller_node:\n  ros__parameters: {law.kind: sgn}\n")
    assert load_scenario("open_loop").controller.law.kind == "sgn"


@pytest.mark.parametrize("name", ["closed_loop", "no/such.yaml", ""])
def test_scenario_that_does_not_exist_is_refused_with_the_names_there_are(name):
    with pytest.raises(ScenarioError) as refused:
        load_scenario(name)
    assert str(refused.value) == f"unknown scenario {name}: it must be one of {', '.join(NAMES)}, or a file"


def test_what_goes_into_a_wheel_holds_types_and_scenarios(tmp_path):
    # A build writes beside its sources.
    source, built = tmp_path / "source", tmp_path / "built"
    shutil.copytree(ROOT / "afm_model", source, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    command = [sys.executable, "setup.py", "-q", "build_py", "--build-lib", built]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    assert sorted(path.stem for path in (built / "afm_model" / "scenarios").iterdir()) == NAMES
    assert (built / "afm_model" / "py.typed").exists()


def test_error_is_that_of_the_scanner_and_of_the_tip_and_the_force_along_y_is_the_true_one(done):
    np.testing.assert_array_equal(done.error[:, :2], done.position[:, :2] - done.reference[:, :2])
    # The height of the cantilever's rest position is 0.
    np.testing.assert_array_equal(done.error[:, 2], done.deflection - done.reference[:, 2])
    # Four samples a tick.
    np.testing.assert_array_equal(done.lateral_force_y, done.channel("truth/lateral_force_y")[::4])
    assert np.abs(done.lateral_force_y).max() > 1e-7


def test_plot_shows_each_quantity_and_z_in_a_panel_of_its_own(done):
    figure = done.plot("a run")
    shown = {axes.get_title(loc="left"): axes for axes in figure.axes}
    assert figure.get_suptitle() == "a run"
    lines = {title: [line.get_label() for line in axes.lines] for title, axes in shown.items()}
    assert lines["scanner position"] == ["reference", "x", "y"]
    assert lines["tracking error of the scanner"] == ["x", "y"]
    assert lines["tracking error of the tip"] == ["z"]
    assert lines["drive"] == ["x", "y", "z"]
    assert {"lateral force along x", "friction loop along x"} <= set(lines)
    loop = shown["friction loop along x"].lines[0].get_xydata()
    np.testing.assert_allclose(loop, 1e9 * np.column_stack([done.position[:, 0], done.lateral_force]))
    matplotlib.pyplot.close(figure)


def test_where_x_and_y_coincide_both_are_seen(done):
    position = next(axes for axes in done.plot().axes if axes.get_title(loc="left") == "scanner position")
    _, x, y = position.lines
    assert x.get_linewidth() > 2.0 * y.get_linewidth()
    assert position.lines.index(x) < position.lines.index(y)
    matplotlib.pyplot.close("all")


def test_plot_without_matplotlib_is_refused_in_one_sentence_and_the_rest_works():
    script = """
import sys
sys.modules["matplotlib"] = None  # as if it were not installed
from afm_model import ControllerParameters, SimParameters, build, simulate
done = simulate(build(SimParameters, {"run.duration": 1e-4}), ControllerParameters())
try:
    done.plot()
except ImportError as error:
    print(error)
"""
    printed = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True).stdout
    assert printed == "a plot needs matplotlib, which is not installed: pip install matplotlib\n"


def test_importing_the_model_and_its_microscope_imports_nothing_that_only_plots_sweeps_and_analyses_need():
    """Every node and every session imports both: each of these would be processor time at every start."""
    names = {"matplotlib", "dask", "distributed", "pandas"}
    names |= {f"scipy.{name}" for name in ("interpolate", "ndimage", "optimize", "signal", "stats")}
    script = f"import sys, afm_model, afm_model.microscope; print({names} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, text=True).stdout == "set()\n"


def test_thinned_curve_keeps_its_ends_and_its_largest_and_least_values():
    y = np.random.default_rng(1).standard_normal(100_003)
    t = np.arange(len(y), dtype=float)
    at, kept = envelope(t, y, 500)
    assert len(at) <= 2 * 502
    assert (at[0], at[-1]) == (t[0], t[-1])
    assert (kept.min(), kept.max()) == (y.min(), y.max())
    assert (np.diff(at) > 0).all()
    np.testing.assert_array_equal(kept, y[at.astype(int)])
