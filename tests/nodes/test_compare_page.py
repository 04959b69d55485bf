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

import pytest
from clusters import cluster_here

from afm_bringup import compare_command
from afm_bringup.compare_page import page
from afm_bringup.compare_robust import robust_laws, robust_line, robust_picture, robust_summary, robust_table
from afm_model import Comparison, compare

LAWS = ["pid", "tanh alpha=0.4", "sgn"]


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    with cluster_here() as scheduler:
        return compare(
            LAWS,
            periods=[2e-5, 5e-5],
            delay_ticks=[0, 2],
            references=["sine 1000"],
            scheduler=scheduler,
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


def test_runs_that_are_not_ranked_are_a_line_a_law_with_the_commonest_reason(comparison):
    lost = comparison.table.assign(error=None)
    own = lost.index[lost["law"] == "sgn"]
    lost.loc[own[:3], "error"] = ["a: this run is not ranked", "b", "a: this run is not ranked"]
    lost.loc[lost["law"] == "pid", "error"] = "the motion diverged"
    lines = list(compare_command.not_ranked(Comparison(lost, comparison.contenders, comparison.common)))
    assert lines == [
        "pid: 4 of 4 runs are not ranked: the motion diverged",
        "sgn: 3 of 4 runs are not ranked: a; 1 for other reasons",
    ]


def test_command_prints_units_and_what_is_not_ranked_below_the_ranking(comparison, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(sys, "argv", ["compare", *LAWS, "--out", str(tmp_path)])
    monkeypatch.setattr(compare_command, "compare", lambda *_, **__: comparison)
    assert compare_command.main() == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert head.split()[:4] == ["law", "runs", "finished", "good"]
    assert lines[len(LAWS)].startswith(
        "finished: runs that are ranked; good: part of the runs with an error_max of 1 %"
    )
    assert "z_rms in m, tip_force in N" in lines[len(LAWS)]
    assert lines[len(LAWS) + 1].startswith("pid: 1 of 4 runs are not ranked: the tip was on the sample for ")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["pid", "--robust", "--friction", "1"], "--friction is not allowed with --robust: the table of wrong models"),
        (["pid", "--robust", "--periods", "5e-5", "--cycles", "2"], "--periods, --cycles is not allowed with --robust"),
        (["pid", "--robust", "--delays", "0"], "--delays is not allowed"),
        (["pid", "--robust", "--references", "sine 50"], "--references is not allowed"),
        (["pid", "--robust", "--scenario", "open_loop"], "--scenario is not allowed"),
        (["pid", "--robust", "--workers", "1"], "--workers is not allowed"),
        (["pid", "--draws", "10"], "--draws 10 is not allowed without --robust"),
        (["pid slowness=0.1,0.2", "--robust"], "law pid slowness=0.1,0.2 is not allowed with --robust, which does not"),
        (["pid", " pid", "--robust"], "law pid is not allowed twice"),
    ],
)
def test_options_that_would_change_nothing_are_refused(monkeypatch, capsys, tmp_path, arguments, words):
    monkeypatch.setattr(sys, "argv", ["compare", *arguments, "--out", str(tmp_path / "out")])
    assert compare_command.main() == 2
    assert capsys.readouterr().err.startswith(f"error: {words}")
    assert not (tmp_path / "out").exists()


def test_help_tells_every_default(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["compare", "--help"])
    with pytest.raises(SystemExit):
        compare_command.main()
    text = " ".join(capsys.readouterr().out.split())
    for default in ("5e-05 0.0002", "0 1", "1.0", "sine 50", "1.5", "10", "0"):
        assert f"(default: {default})" in text
