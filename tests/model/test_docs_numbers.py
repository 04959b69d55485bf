"""Claims about docs/: figures and tables are those that the scripts make, small, and complete."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from afm_model.core import registry
from afm_model.core.schema import specifications

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
sys.path.insert(0, str(ROOT / "tools"))

import measure_numerics as measure  # noqa: E402
from figures import numbers, page  # noqa: E402
from figures.runs import Runs  # noqa: E402
from make_figures import FIGURES  # noqa: E402
from numerics.adaptive import solve  # noqa: E402
from numerics.problem import error  # noqa: E402

FAST = {"plant__control_period": 5e-7, "plant__dt": 5e-7, "detector__sample_period": 5e-7}
CLOSED = DOCS / "paper.md", "closed_loop"
VARIATION = "total variation of $U_x$ per unit of time"
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> Path:
    """All figures, of runs cut to 2 ms of simulated time."""
    folder = tmp_path_factory.mktemp("figures")
    command = [sys.executable, ROOT / "tools" / "make_figures.py", "--duration", "2e-3", "--dpi", "40", "--out", folder]
    subprocess.run(command, check=True)
    return folder


@pytest.mark.parametrize("name", FIGURES)
@pytest.mark.parametrize("kind", ["png", "svg"])
def test_every_figure_is_drawn_from_scenario_files_alone(drawn, name, kind):
    start = (drawn / f"{name}.{kind}").read_bytes()[:64]
    assert start.startswith(b"\x89PNG") if kind == "png" else b"<?xml" in start


@pytest.mark.parametrize("name", FIGURES)
def test_committed_figures_are_shown_and_below_200_kB(name):
    page = {"both_loops": ROOT / "README.md", "tuning": DOCS / "tuning.md"}.get(name, DOCS / "paper.md")
    assert f"figures/{name}.png" in page.read_text()
    for kind in ("png", "svg"):
        assert (DOCS / "figures" / f"{name}.{kind}").stat().st_size < 200_000


def test_unknown_figure_is_refused_with_the_names_there_are():
    tool = subprocess.run(
        [sys.executable, ROOT / "tools" / "make_figures.py", "figure_7"], capture_output=True, text=True
    )
    assert tool.returncode == 2
    assert "there is no figure figure_7; there are figure_2" in tool.stderr


def cells(lines: list[str]) -> list[list[str]]:
    """Cells of the lines of a table, without the line under the heading."""
    rows = [line.replace("\\|", "¦").strip().strip("|").split("|") for line in lines[:1] + lines[2:]]
    return [[cell.strip() for cell in row] for row in rows]


def compare(printed: list[list[str]], made: list[list[str]], rel: float, skip: tuple[str, ...] = ()) -> None:
    """Same headings and rows, same numbers within `rel`."""
    assert printed[0] == made[0]
    assert [row[0] for row in printed] == [row[0] for row in made]
    for old, new in zip(printed[1:], made[1:], strict=True):
        if old[0] not in skip:
            numbers_old, numbers_new = (
                [float(n) for cell in row[1:] for n in NUMBER.findall(cell)] for row in (old, new)
            )
            assert numbers_new == pytest.approx(numbers_old, rel=rel), old[0]


def test_table_of_the_open_loop_is_that_of_the_runs():
    # Half of the last digit printed, at worst that of 0.033; counts are exact.
    compare(page.read(DOCS / "paper.md", "open_loop"), cells(numbers.open_loop(Runs())), rel=1e-6)


@pytest.mark.parametrize(("name", "rms"), [("closed_loop_sgn", 0.101), ("closed_loop_tanh", 0.133)])
def test_slower_control_of_the_scenarios_gives_the_errors_in_the_text(name, rms):
    made = cells(numbers.closed_loop(Runs(), (("", name, numbers.HALF),)))
    assert f"{rms:g}" in (DOCS / "paper.md").read_text()
    # Half of the last digit given; the chatter of sgn may differ on another machine.
    assert float(made[1][1].split()[0]) == pytest.approx(rms, abs=5e-4)


def test_text_of_the_paper_page_follows_from_its_tables():
    text = (DOCS / "paper.md").read_text()
    held, computed, compliant = (
        {row[0]: NUMBER.findall(row[i]) for row in page.read(DOCS / "paper.md", "open_loop")[1:]} for i in (1, 2, 3)
    )
    low, high = (float(n) for n in compliant["normal force [60 nN]"])
    assert round(60.0 * (high - low)) == 29
    assert "swings by 29 nN" in text
    assert [c["stick phases"] for c in (held, computed, compliant)] == [["22"], ["16"], ["16"]]
    for row in ("largest ¦x¦ [$x_0$]", "largest ¦y¦ [$x_0$]", "rms $y - y_r$ [$x_0$]"):
        assert 0.02 < 1.0 - float(compliant[row][0]) / float(held[row][0]) < 0.032
    closed = {row[0]: [float(NUMBER.findall(cell)[0]) for cell in row[1:] if cell] for row in page.read(*CLOSED)[1:]}
    sgn, _, _, drawn, tanh, _ = closed[VARIATION]
    assert (sgn, drawn) == (13_000.0, 5.8)
    assert sgn / tanh == pytest.approx(3e5, rel=0.1)  # one digit is given
    assert closed["rms $e_z$"][:2] == pytest.approx([0.09, 15.0], rel=0.05)  # two digits are given
    factor = float(held["rms $x - x_r$ [$x_0$]"][0]) / closed["rms $e_x$ [$x_0$]"][0]
    assert factor == pytest.approx(3500.0, abs=50.0)


def test_table_of_the_closed_loop_is_that_of_the_runs():
    printed = page.read(DOCS / "paper.md", "closed_loop")
    # Five times the control period is still short for tanh; what depends on the period is skipped.
    smooth = cells(numbers.closed_loop(Runs(), numbers.CLOSED_LOOP[4:], **FAST))
    compare([row[:1] + row[5:] for row in printed], smooth, rel=0.01)
    drawn = cells(numbers.closed_loop(Runs(), numbers.CLOSED_LOOP[3:4], **FAST))
    compare([[row[0], row[4]] for row in printed], drawn, rel=0.01, skip=("rms $e_z$", VARIATION))
    chatter = cells(numbers.closed_loop(Runs(), numbers.CLOSED_LOOP[1:2]))
    # A chattering run may differ in its last digits on another machine.
    compare([[row[0], row[2]] for row in printed], chatter, rel=0.05)


def test_table_of_fixed_steps_is_what_the_schemes_do(period):
    printed = {row[0]: row[1:] for row in page.read(DOCS / "numerics.md", "fixed")}
    points = len(period.times)
    for name, scheme in measure.SCHEMES:
        cells = printed[name.replace("\\|", "¦")]
        found = [error(measure.run(scheme, h, points), period) for h in measure.STEPS[:3]]
        smooth = "RK4" not in name
        # RK4 flips at every step while it should rest: another machine may flip otherwise, not less.
        assert found == pytest.approx([float(cell) for cell in cells[:3]], rel=0.1 if smooth else 0.5)
    project = [float(cell) for cell in printed[measure.SCHEMES[0][0]][:4]]
    assert all(np.diff(project) < 0.0)


def test_table_of_the_order_is_what_the_scheme_does(period):
    made = cells(measure.order_table(period, measure.FINE_STEPS))
    # Two digits are printed.
    compare(page.read(DOCS / "numerics.md", "order"), made, rel=0.05)


def test_regularised_friction_is_wrong_by_its_width_and_an_explicit_adaptive_method_does_not_get_through(period):
    rows = {(row[0], row[2]): row for row in page.read(DOCS / "numerics.md", "adaptive")[1:] if row[1] == "1e-06"}
    for v_s in (1e-2, 1e-3, 1e-4):
        printed = rows["LSODA", f"tanh, $v_s$ = {v_s:g}"]
        found = solve(period, "LSODA", 1e-6, v_s)
        assert found.error == pytest.approx(float(printed[3]), rel=0.05)  # two digits are printed
        # "about 420 v_s"
        assert found.error == pytest.approx(420.0 * v_s, rel=0.15)
    stopped = solve(period, "RK45", 1e-6, 0.0, most=50_000)
    assert np.isnan(stopped.error)
    # It passes the first rest, of 93.563 units, where nothing changes, and stalls at the first slip.
    assert period.stick_phases[0][1] < stopped.reached < period.stick_phases[0][1] + 0.01
    assert rows["RK45", "$f v/¦v¦$"][3] == f"stopped at t = {stopped.reached:.2f}"


def test_page_without_a_place_for_the_table_is_refused(tmp_path):
    empty = tmp_path / "page.md"
    empty.write_text("nothing\n")
    with pytest.raises(ValueError, match="holds no place for the table order"):
        page.insert(empty, "order", ["| |"])


def test_links_of_the_pages_lead_to_files():
    for name in ("paper.md", "theory.md", "numerics.md", "laws.md", "predictive.md", "controllers.md"):
        prose = re.sub(r"```.*?```", "", (DOCS / name).read_text(), flags=re.DOTALL)  # code has other brackets
        targets = re.findall(r"\]\(([^)#]+)\)", prose)
        assert targets, name
        for target in targets:
            if not target.startswith("http"):
                assert (DOCS / target).exists(), f"{name}: {target}"


def test_every_equation_is_numbered_once_and_in_order():
    tags = [int(n) for n in re.findall(r"\\tag\{(\d+)\}", (DOCS / "theory.md").read_text())]
    assert tags == list(range(1, len(tags) + 1))


LAWS_CITATION = re.compile(r"(?:laws|predictive)\.md,?\s+(\(\d\.\d+\)(?:(?:,|\s|and|to)*\(\d\.\d+\))*)")
LEVER_CITATION = re.compile(r"lever\.md\s+(\(\d+\)(?:(?:,|\s|and|to|by|of)*\(\d+\))*)")
CITATION = re.compile(r"theory\.md\s+(\(\d+\)(?:(?:,|\s|and|to|by|of)*\(\d+\))*)")
KERNELS = ("plant", "contact", "friction", "law", "sample")
"""Packages whose every module is an equation of the theory, or several."""
NO_EQUATION = (
    *("presets.py", "map_files.py", "map_reader.py", "tip.py"),
    *("flat.py", "plane.py", "patches.py", "rough.py", "height_map.py", "dilation.py"),
)
"""Modules that hold numbers, files, or a shape that their own lines tell."""


def cited(source: Path) -> list[int]:
    """Equations of the theory that a module cites, every number of "theory.md (5), (7) to (9)"."""
    return [int(n) for found in CITATION.findall(source.read_text()) for n in re.findall(r"\d+", found)]


def cited_laws(source: Path) -> list[str]:
    """Equations of docs/laws.md and docs/predictive.md that a module cites."""
    return [n for found in LAWS_CITATION.findall(source.read_text()) for n in re.findall(r"\d\.\d+", found)]


def cited_lever(source: Path) -> list[int]:
    """Equations of docs/lever.md that a module cites."""
    return [int(n) for found in LEVER_CITATION.findall(source.read_text()) for n in re.findall(r"\d+", found)]


def test_docstrings_cite_equations_of_the_lever_that_exist():
    # Those of its dynamic modes go on from there, on a page of their own.
    pages = (DOCS / "lever.md").read_text() + (DOCS / "dynamic.md").read_text()
    tags = [int(n) for n in re.findall(r"\\tag\{(\d+)\}", pages)]
    assert sorted(tags) == list(range(1, len(tags) + 1))
    cites = [n for source in (ROOT / "afm_model" / "afm_model").rglob("*.py") for n in cited_lever(source)]
    assert cites and set(cites) <= set(tags)


@pytest.mark.parametrize("family", ["sample", "piezo", "plant", "program", "detector", "onboard", "fault", "law"])
def test_page_of_parameters_has_those_of_every_kind(family):
    listed = set(re.findall(r"`(\w+\.\w+)`", (DOCS / "parameters.md").read_text()))
    group = "reference" if family == "program" else family
    for kind in registry.names(family):
        assert {each.name for each in specifications(registry.find(family, kind).parameters, f"{group}.")} <= listed


def test_docstrings_cite_equations_of_the_laws_that_exist():
    tags, of_predictive = (
        re.findall(r"\\tag\{(\d\.\d+)\}", (DOCS / page).read_text()) for page in ("laws.md", "predictive.md")
    )
    assert tags == sorted(set(tags)) and all(tag < "8" for tag in tags)
    assert len(of_predictive) == len(set(of_predictive)) and all(tag.startswith("8.") for tag in of_predictive)
    tags += of_predictive
    cites = [n for source in ROOT.glob("afm_*/afm_*/**/*.py") for n in cited_laws(source)]
    assert cites and set(cites) <= set(tags)


def test_docstrings_cite_equations_that_exist():
    last = max(int(n) for n in re.findall(r"\\tag\{(\d+)\}", (DOCS / "theory.md").read_text()))
    sources = list((ROOT / "afm_model" / "afm_model").rglob("*.py"))
    assert max(n for source in sources for n in cited(source)) <= last
    assert [str(s) for s in sources if re.search(r"\bequation \d", s.read_text())] == []  # whose?


def test_every_module_of_the_physics_cites_its_equations():
    model = ROOT / "afm_model" / "afm_model"
    modules = [
        m
        for package in KERNELS
        for m in (model / package).glob("*.py")
        # The last two hold no equation: an excitation without feedback, no law at all.
        if m.name not in ("__init__.py", "parameters.py", "state.py", "chirp.py", "external.py", *NO_EQUATION)
    ]
    assert [m.name for m in modules if not cited(m) and not cited_laws(m) and not cited_lever(m)] == []


@pytest.mark.parametrize(
    ("equation", "module", "name"),
    [
        (1, "contact/jkr.py", "def contact_radius"),
        (11, "contact/jkr.py", "def u_of_indentation"),
        (13, "contact/friction.py", "def bound_of_load"),
        (14, "contact/friction.py", "def bound_of_area"),
        (17, "contact/jkr.py", "def effective_radius_ratio"),
        (21, "plant/statics.py", "def place_sample"),
        (25, "plant/paper.py", "def _kick_tip"),
        (27, "plant/statics.py", "def static_load"),
        (30, "law/lyapunov.py", "def lyapunov_matrix"),
        (35, "law/lyapunov.py", "def ultimate_bound"),
        (39, "contact/friction.py", "def friction_impulse"),
    ],
)
def test_functions_cite_the_equation_they_are(equation, module, name):
    text = (ROOT / "afm_model" / "afm_model" / module).read_text()
    body = text.partition(name)[2].partition("\n\n\n")[0]
    assert equation in [int(n) for found in CITATION.findall(body) for n in re.findall(r"\d+", found)]
