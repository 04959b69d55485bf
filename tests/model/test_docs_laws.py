"""Claims about the tables of docs/laws.md and docs/predictive.md: each has its place and is what the tools make now."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import make_laws  # noqa: E402
import measure_predictive  # noqa: E402
from figures.page import read as read_table  # noqa: E402
from laboratory import laboratory  # noqa: E402
from law_pages import PAGES, marks, page_of, put  # noqa: E402

from afm_bringup.compare_robust import robust_table  # noqa: E402
from afm_model.studies.contender import contender  # noqa: E402
from afm_model.studies.wrong_models import CASE, CASES, RATES, run_case  # noqa: E402


def read(mark: str) -> list[list[str]]:
    """Cells of a table, from the page that holds it."""
    return read_table(page_of(mark), mark)


def cell_of(case: str, rate: str) -> str:
    """What the table of wrong models has for `predictive` there, run now."""
    chosen = CASE[case], next(each for each in RATES if each.title == rate)
    rows = [
        {"law": law, "case": case, "rate": rate, **run_case(*chosen, contender(law))} for law in make_laws.PREDICTIVE
    ]
    return robust_table(rows).splitlines()[2].strip("|").split("|")[1].strip()


@pytest.mark.parametrize(
    ("case", "rate"),
    [
        ("the truth", "50 us + 1"),
        ("resonances +2 %", "200 us + 1"),
        ("friction x 0.5", "200 us + 1"),
        ("lateral gain 1.1", "1 ms packets"),
    ],
)
def test_row_of_the_table_of_wrong_models_is_what_the_law_does_now(case, rate):
    head, *rows = read("laws wrong")
    printed = {row[0]: row for row in rows}
    assert list(printed) == [each.title for each in CASES]
    assert printed[case][head.index(rate)] == cell_of(case, rate)


def test_measured_tables_are_what_the_law_does_now():
    head, *rows = read("predictive knowledge")
    printed = {row[0]: row for row in rows}
    _, _, now = measure_predictive.knowledge(["surface and friction known"], ["50 us + 1"])
    assert printed["surface and friction known"][head.index("50 us + 1")] == now.strip("|").split("|")[1].strip()


def test_table_of_a_laboratory_microscope_is_what_the_laws_do_now():
    rows = {row[0]: row[1:] for row in read("laws laboratory")}
    _, _, now = laboratory(["and 50 pm of noise"], [5e-9]).splitlines()
    title, *cells = [cell.strip() for cell in now.strip("|").split("|")]
    assert rows[title] == cells


def test_every_table_of_the_pages_is_made_by_one_command():
    found = [mark for page in PAGES for mark in marks(page)]
    assert len(found) == len(set(found))
    assert set(found) == set(make_laws.every())
    assert all(len(read(mark)) > 1 for mark in found)


def test_tables_of_all_laws_and_of_predictive_are_in_their_pages():
    assert [page.name for page in PAGES] == ["laws.md", "predictive.md"]
    assert marks(PAGES[0]) == ["laws laws", "laws laboratory"]
    assert {page_of(f"predictive {name}") for name in measure_predictive.TABLES} == {PAGES[1]}


def test_a_table_is_put_into_the_page_that_has_its_mark_and_nothing_else_changes(tmp_path, monkeypatch):
    pages = tuple(tmp_path / page.name for page in PAGES)
    pages[0].write_text("all\n<!-- a b -->\n1\n<!-- end -->\n")
    pages[1].write_text("\n<!-- c -->\n2\n<!-- end -->\n")
    monkeypatch.setattr("law_pages.PAGES", pages)
    put("c", "| new |")
    assert [page.read_text() for page in pages] == [
        "all\n<!-- a b -->\n1\n<!-- end -->\n",
        "\n<!-- c -->\n| new |\n<!-- end -->\n",
    ]
    with pytest.raises(ValueError, match="<!-- d -->"):
        put("d", "| new |")


def test_tools_write_each_table_into_its_page(monkeypatch):
    written = []
    monkeypatch.setattr(make_laws, "put", lambda mark, text: written.append((mark, text)))
    monkeypatch.setattr(make_laws, "every", lambda: {"laws laws": lambda: "1", "bound edge": lambda: "2"})
    monkeypatch.setattr("sys.argv", ["make_laws.py", "edge", "--write"])
    make_laws.main()
    monkeypatch.setattr("law_pages.put", lambda mark, text: written.append((mark, text)))
    monkeypatch.setattr(measure_predictive, "TABLES", {"late": lambda: ["5", "6"]})
    monkeypatch.setattr("sys.argv", ["measure_predictive.py", "--write"])
    measure_predictive.main()
    assert written == [("bound edge", "2"), ("predictive late", "5\n6")]
