"""Claims about notebooks/: every one runs, shows what the file shows, and what it says is so."""

import json
import math
import re
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path

import gwyfile
import h5py
import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from ..test_docs_links import anchors
from .notebook import Ran, run

ROOT = Path(__file__).resolve().parents[3]
NAMES = ("paper", "controller", "experiment", "tapping", "fit")
RUN = [pytest.param(name, marks=[pytest.mark.long, pytest.mark.timeout(0)] if name == "fit" else []) for name in NAMES]
"""What `fit` simulates takes minutes."""
Get = Callable[[str], Ran]


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Get:
    """Each notebook, run once, in a copy of the folder: nothing is written into the clone."""
    folder = tmp_path_factory.mktemp("clone") / "notebooks"
    folder.mkdir()
    for path in (*(ROOT / "notebooks").glob("*.ipynb"), *(ROOT / "notebooks").glob("*.py")):
        shutil.copy(path, folder)
    (folder.parent / "docs").symlink_to(ROOT / "docs")
    return cache(lambda name: run(folder / f"{name}.ipynb"))


def test_all_notebooks_are_tested():
    assert {path.stem for path in (ROOT / "notebooks").glob("*.ipynb")} == set(NAMES)


@pytest.mark.parametrize("name", RUN)
def test_notebook_shows_what_its_file_shows(ran: Get, name: str):
    """The file was made with a real kernel, by `make notebooks`: this run must print the same."""
    done = ran(name)
    for now, stored in zip(done.shown, done.stored, strict=True):
        assert now == stored
    assert sum(shown.figures for shown in done.shown) >= 1
    assert done.unlabelled == []


@pytest.mark.parametrize("name", NAMES)
def test_file_of_a_notebook_is_small_whole_and_free_of_where_it_was_made(name: str):
    path = ROOT / "notebooks" / f"{name}.ipynb"
    assert path.stat().st_size < 300_000
    text = path.read_text()
    notebook = json.loads(text)
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    assert set(notebook["metadata"]) == {"kernelspec", "language_info"}
    assert str(Path.home()) not in text and "/tmp/" not in text


@pytest.mark.parametrize("name", NAMES)
def test_every_link_of_a_notebook_leads_to_a_file_and_a_heading_that_exist(name: str):
    cells = json.loads((ROOT / "notebooks" / f"{name}.ipynb").read_text())["cells"]
    text = "".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    links = [link for link in re.findall(r"\]\(([^)\s]+)\)", text) if not link.startswith("https://")]
    assert links
    for link in links:
        file, _, anchor = link.partition("#")
        target = (ROOT / "notebooks" / file).resolve()
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


def test_notebook_of_the_paper_reproduces_its_figures(ran: Get):
    paper = ran("paper")
    # Figure 2: a finite radius at a finite tension, (1) of docs/theory.md at both points.
    assert paper["pull_off"] == pytest.approx(3.0 * math.pi * paper["contact"].R * paper["contact"].gamma, rel=1e-12)
    assert paper["a_pull_off"] == pytest.approx(paper["a_0"] / 4.0 ** (1.0 / 3.0), rel=1e-9)
    # Figures 4 to 6, as docs/paper.md has them.
    assert paper["open_loop"].trajectory_sha256.startswith("c9204fe9")
    assert paper["closed_loop"].trajectory_sha256.startswith("94bef7de")
    assert paper["tanh"].trajectory_sha256.startswith("cbc7e80a")
    assert paper["open_loop"].score.stick_phases == 22
    assert paper["ratio"] == pytest.approx(3500, rel=0.01)  # two digits said


def test_notebook_of_the_paper_shows_what_its_corrections_do(ran: Get):
    paper = ran("paper")
    # C1: it does not move, but by what the held tip gives way: nothing at all.
    assert paper["travel_printed"] < 1e-3 * paper["travel"]
    # C10: the ball shrinks with alpha, and the run ends inside.
    balls = paper["balls"]
    assert balls[0] > balls[1] > balls[2]
    assert paper["measured"] < balls[1] < 2.0 * paper["law"].M_x
    smoother = paper["laws"]["travel [nN/ms]"]
    assert smoother["sgn"] / smoother["tanh, alpha = 20"] == pytest.approx(2000, rel=0.2)  # "two thousand times"
    assert paper["laws"]["rms e_x [pm]"]["tanh, alpha = 20"] / paper["laws"]["rms e_x [pm]"]["sgn"] == pytest.approx(
        4.0, rel=0.05
    )


def test_notebook_of_a_controller_ranks_it_where_it_says(ran: Get):
    controller = ran("controller")
    table = controller["at_once"].set_index(["law", "period"])
    error = table["error_max"]
    for period in (2e-5, 1e-4):
        assert error["my_law:MINE", period] < error["pid", period]
        # Close to the observer when as fast: within a half.
        assert error["my_law:MINE slowness=2", period] < 1.5 * error["observer", period]
        assert (table["margin"]["my_law:MINE", period]) > 0.3
    assert error["my_law:MINE", 2e-5] < error["tanh", 2e-5]
    assert table["error"]["tanh", 1e-4].startswith("the motion diverged")
    under = error[error < 1.0].index
    assert [law for law, period in under if period == 1e-4] == ["predictive"]


def test_notebook_of_a_controller_makes_a_row_of_its_table_again_to_the_last_bit(ran: Get):
    controller = ran("controller")
    assert controller["same"] is True


def test_notebook_of_a_controller_tells_that_a_delay_makes_its_loop_unstable(ran: Get):
    delayed = ran("controller")["delayed"].set_index("law")
    assert delayed["margin"]["my_law:MINE"] == 0.0
    assert delayed["chatter"]["my_law:MINE"] > 10.0
    assert delayed["margin"]["observer"] == 0.0
    assert delayed["chatter"]["observer"] > 100.0
    assert delayed["error_max"].idxmin() == "predictive"


def test_notebook_of_an_experiment_finds_the_patch_it_was_not_told_of(ran: Get):
    experiment = ran("experiment")
    pixel = 800e-9 / 64
    # The mean over some 160 pixels: a fifth of one. Along y by as much further as the text says of 10 nm of deflection.
    assert experiment["patch_x"] == pytest.approx(experiment["true_x"], abs=0.2 * pixel)
    assert experiment["patch_y"] == pytest.approx(experiment["true_y"] + 0.3 * 10e-9, abs=0.2 * pixel)
    assert experiment["radius"] == pytest.approx(experiment["TRUE_RADIUS"], abs=0.2 * pixel)
    # The height does not show it: less the waves that were given, it is as high as the rest.
    image, nodes = experiment["image"], experiment["nodes"]
    waves = RegularGridInterpolator((nodes, nodes), experiment["maps"]["file"])((image.place_y, image.place_x))
    rest = image.height.mean("direction") - waves
    distance = np.hypot(image.place_x - experiment["patch_x"], image.place_y - experiment["patch_y"])
    step = rest.where(distance < 60e-9).mean() - rest.where(distance > 120e-9).mean()
    assert abs(float(step)) < 0.2 * float(waves.std())


def test_notebook_of_an_experiment_measures_the_adhesion_of_both_materials(ran: Get):
    experiment = ran("experiment")
    low, high = experiment["levels"]
    # From 1.5 to 2 pi w R: more of w where there is less of it.
    assert 0.6 < low / high < 0.64
    # Both see the same edge: within half a step of the map.
    assert experiment["edge"] == pytest.approx(experiment["radius"], abs=0.5 * 100e-9 / 6)
    assert not experiment["microscope"].state.approached


def test_files_of_the_notebook_of_an_experiment_hold_what_it_measured(ran: Get):
    experiment = ran("experiment")
    folder = experiment.folder / experiment["OUT"]
    channels = gwyfile.util.get_datafields(gwyfile.load(str(folder / "patch.gwy")))
    friction = next(field for title, field in channels.items() if title.startswith("Friction"))
    np.testing.assert_array_equal(friction.data[::-1], experiment["image"].friction.values)
    with h5py.File(folder / "edge.h5") as file:
        assert len(file) == len(experiment["places"]) == 49


def test_notebook_of_tapping_tunes_to_the_resonance_and_counts_the_phase_from_there(ran: Get):
    tuned, curve = ran("tapping")["tuned"], ran("tapping")["curve"]
    assert tuned.f0_Hz == pytest.approx(77e3, abs=4.0 * tuned.f0_Hz_uncertainty)
    assert tuned.Q == pytest.approx(165.0, abs=4.0 * tuned.Q_uncertainty)
    far = curve.isel(point=slice(0, 20)).mean("point")
    np.testing.assert_allclose(far.phase, 0.5 * math.pi, atol=2e-3)
    np.testing.assert_allclose(far.amplitude, 40e-9, rtol=1e-3)
    # Of the branches both exist from the one to the other distance.
    assert ran("tapping")["jump"](0) < ran("tapping")["jump"](1) - 1e-9


def test_notebook_of_tapping_shows_the_islands_by_phase_and_their_energy_as_the_account_has_it(ran: Get):
    tapping = ran("tapping")
    image, gentle = tapping["image"], tapping["gentle"]
    phase = np.degrees(image.phase[0].values)
    pixel = 300e-9 / 40
    area = np.count_nonzero(phase > 0.5 * (phase.min() + phase.max())) * pixel**2
    assert area == pytest.approx(math.pi * sum(radius**2 for *_, radius in tapping["ISLANDS"]), rel=0.05)
    ratios = []
    for part in (tapping["island"], tapping["matrix"]):
        both = [float(tapping[name].values[part[:, -tapping[name].x.size :]].mean()) for name in ("energy", "account")]
        # (43) leaves out the other modes.
        assert both[0] == pytest.approx(both[1], rel=0.02)
        ratios.append(both[0])
        # (43) of an elastic contact, but for the motion of the base: pi - arcsin(A / A0).
        attraction = float(np.median(gentle.phase[0].values[part]))
        assert attraction == pytest.approx(math.pi - math.asin(0.8), abs=math.radians(1.0))
    assert ratios[0] > 3.0 * ratios[1]


def test_notebook_of_tapping_leaves_a_file_of_its_image(ran: Get):
    tapping = ran("tapping")
    channels = gwyfile.util.get_datafields(gwyfile.load(str(tapping.folder / tapping["OUT"] / "blend.gwy")))
    np.testing.assert_array_equal(channels["Phase"].data[::-1], tapping["image"].phase[0].values)


@pytest.mark.long
@pytest.mark.timeout(0)
def test_error_bars_of_a_fit_hold_the_truth_as_often_as_they_say(ran: Get):
    fit = ran("fit")
    trials = fit["TRIALS"]
    assert trials >= 50
    for inside, part in ((fit["inside68"], 0.68), (fit["inside95"], 0.95)):
        # Three standard deviations of a count, for each parameter.
        allowed = 3.0 * math.sqrt(trials * part * (1.0 - part))
        assert np.abs(inside.sum(axis=0) - part * trials).max() <= allowed
    page = (ROOT / "docs" / "learning.md").read_text()
    for name in ("inside68", "inside95"):
        shares = 100.0 * fit[name].mean(axis=0)
        assert f"{shares.min():.0f} to {shares.max():.0f} %" in page
    # And they are narrow: of a fifth of what was thought possible at most.
    width = fit["intervals"][:, 3] - fit["intervals"][:, 1]
    assert (width.mean(axis=0) < 0.2 * (fit["fit"].HIGH - fit["fit"].LOW)).all()
