"""Claims about the tables of docs/laws.md: each has its place and is what the tools make of the code as it is."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import make_laws  # noqa: E402
import measure_predictive  # noqa: E402
from figures.page import read  # noqa: E402

from afm_bringup.compare_robust import robust_table  # noqa: E402
from afm_model.studies.contender import contender  # noqa: E402
from afm_model.studies.wrong_models import CASE, CASES, RATES, run_case  # noqa: E402

PAGE = ROOT / "docs" / "laws.md"


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
    head, *rows = read(PAGE, "laws wrong")
    printed = {row[0]: row for row in rows}
    assert list(printed) == [each.title for each in CASES]
    assert printed[case][head.index(rate)] == cell_of(case, rate)


def test_what_is_said_to_be_reached_is_in_the_table():
    head, *rows = read(PAGE, "laws wrong")
    table = {row[0]: dict(zip(head[1:], row[1:], strict=True)) for row in rows}
    _, *asked = read(PAGE, "laws asked")
    assert [row[:2] for row in asked] == [[title, rate.title] for title, _, _ in make_laws.ASKED for rate in RATES]
    for title, rate, wanted, reached, reason in asked:
        if title in table:
            cells = [each.partition("→")[2].strip("!") for each in table[title][rate].split(";")]
            assert reached.replace("**", "").split(" / ") == cells
        limits = [float(each) for each in wanted.split(" / ")]
        numbers = [float(each) for each in re.findall(r"(?:^| / )\**([\d.]+)", reached)]
        over = [each > limit * 1.005 for each, limit in zip(numbers, limits * (3 // len(limits)), strict=True)]
        assert any(over) == bool(reason) == ("**" in reached)


def test_measured_tables_are_what_the_law_does_now():
    head, *rows = read(PAGE, "predictive knowledge")
    printed = {row[0]: row for row in rows}
    _, _, now = measure_predictive.knowledge(["surface and friction known"], ["50 us + 1"])
    assert printed["surface and friction known"][head.index("50 us + 1")] == now.strip("|").split("|")[1].strip()


def test_every_table_of_the_page_is_made_by_one_command():
    marks = re.findall(r"^<!-- (?!end)(.*) -->$", PAGE.read_text(), re.MULTILINE)
    assert set(marks) == set(make_laws.every())
    assert all(len(read(PAGE, mark)) > 1 for mark in marks)
