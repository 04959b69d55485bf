"""Claims about `compare` as a command: a table, a ranking, and one page that needs nothing else."""

import base64
import math
import re
import sys
import warnings
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import distributed
import pytest

from afm_bringup import compare_command
from afm_bringup.compare_page import page
from afm_bringup.compare_robust import robust_laws, robust_line, robust_picture, robust_summary, robust_table
from afm_model import Comparison, compare

LAWS = ["pid", "tanh alpha=0.4", "sgn"]


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address="127.0.0.1:0"
    ) as running:
        return compare(
            LAWS,
            periods=[2e-5, 5e-5],
            delay_ticks=[0, 2],
            references=["sine 1000"],
            scheduler=running.scheduler_address,
            progress=False,
        )


class Links(HTMLParser):
    """What a page asks for, and whether its tags are closed."""

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[str] = []
        self.open: list[str] = []
        self.rows = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.asked += [value or "" for name, value in attrs if name in ("src", "href")]
        self.rows += tag == "tr"
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_page_needs_no_other_file_and_its_pictures_are_drawings(comparison):
    reader = Links()
    reader.feed(page(comparison))
    reader.close()
    assert reader.open == []
    assert len(reader.asked) == 2
    for each in reader.asked:
        kind, _, data = each.partition(",")
        assert kind == "data:image/svg+xml;base64"
        assert ElementTree.fromstring(base64.b64decode(data)).tag.endswith("svg")
    assert reader.rows == 1 + len(LAWS) + 1 + len(comparison.table)


def test_page_tells_what_each_law_knows_and_why_a_run_failed(comparison):
    text = page(comparison)
    for row in comparison.ranking().to_dict("records"):
        assert row["law"] in text and row["knowledge"] in text
    lost = comparison.table["error"].dropna()
    assert len(lost) > 0 and all(str(each) in text for each in lost)
    assert text.count('<tr class="bad">') == len(lost)


def test_text_of_a_law_does_not_break_the_page(comparison):
    odd = Comparison(comparison.table.replace("pid", "<b>&pid"), comparison.contenders, comparison.common)
    assert "<b>" not in page(odd).split("<h1>")[1].split("<img")[0]
    assert "&lt;b&gt;&amp;pid" in page(odd)


def test_command_of_a_node_breaks_neither_page_nor_table_for_latex(comparison):
    label = r"sh -c 'node ~/{a}_$X$ \frac'" + " --and-more" * 9
    nodes = tuple(replace(each, label=label) if each.label == "pid" else each for each in comparison.contenders)
    odd = Comparison(comparison.table.replace("pid", label), nodes, comparison.common)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of a figure without room for its axes
        assert "--and-more" in page(odd)
    assert r"node \textasciitilde{}/\{a\}\_\$X\$ \textbackslash{}frac" in odd.to_latex()


def test_page_of_runs_that_all_failed_is_drawn(comparison):
    lost = comparison.table.assign(error="the motion diverged", error_max=float("nan"), chatter=float("nan"))
    assert "the motion diverged" in page(Comparison(lost, comparison.contenders, comparison.common))


def test_results_are_written_into_the_folder(comparison, tmp_path):
    compare_command.write(comparison, tmp_path / "new" / "folder")
    assert {file.name for file in (tmp_path / "new" / "folder").iterdir()} == {
        compare_command.CSV,
        compare_command.LATEX,
        compare_command.PAGE,
    }


def test_command_refuses_in_a_sentence(monkeypatch, capsys, tmp_path: Path):
    monkeypatch.setattr(sys, "argv", ["compare", "pidd", "--out", str(tmp_path / "out")])
    assert compare_command.main() == 2
    assert re.match(r"error: there is no law pidd: it must be one of ", capsys.readouterr().err)
    assert not (tmp_path / "out").exists()


def test_table_of_wrong_models_is_a_picture_and_a_table_with_the_worst_the_median_and_what_is_lost():
    row = {"law": "mine", "rate": "50 us", "first": 3.0, "contact": 1.0, "load": 1e-9, "lost": ""}
    rows = [row | {"case": f"case {third:g}", "third": third, "worst": third} for third in (0.5, 20.0)]
    rows[0]["worst"] = 0.7  # of several runs
    infinite = dict.fromkeys(("first", "third", "worst"), math.inf)
    rows.append(row | {"case": "bad", "lost": "the motion diverged"} | infinite)
    assert robust_summary(rows) == "mine: median 20 %, worst diverged (bad, 50 us), 1 of 3 lost"
    both = rows + [each | {"law": "other", "third": 0.1, "worst": 0.1, "first": 0.2, "lost": ""} for each in rows]
    assert robust_table(both).splitlines()[2:] == [
        "| case 0.5 | 3→0.5 (0.7); 0.2→0.1 |",
        "| case 20 | 3→20; 0.2→0.1 |",
        "| bad | -; 0.2→0.1 |",
    ]
    assert robust_laws(both).splitlines()[2:] == [
        "| `mine` | 3 → 20 | diverged (bad, 50 us) | 1 of 3 |",
        "| `other` | 0.2 → 0.1 | 0.1 (case 0.5, 50 us) | 0 of 3 |",
    ]
    assert robust_line(rows[0]) == "mine: 50 us, case 0.5: 3 % in the first period, 0.5 % in the third, at worst 0.7 %"
    assert robust_line(rows[2]).endswith(
        "bad: diverged in the first period, diverged in the third; lost: the motion diverged"
    )
    mine, other = robust_picture(both).axes
    crosses = [line for line in mine.lines if line.get_marker() == "x"]
    assert sum(len(line.get_xdata()) for line in crosses) == 1
    assert "1 of 3 lost" in mine.get_title() and "0 of 3 lost" in other.get_title()
