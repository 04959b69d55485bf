"""Claims about the prose: links lead somewhere, the glossary explains the words that the software uses."""

import ast
import re
from dataclasses import fields
from pathlib import Path

import pytest

from afm_model import ScoreSummary, Simulation
from afm_model.parameters import SimParameters, specifications

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
GLOSSARY = (ROOT / "docs" / "glossary.md").read_text()


def prose(page: Path) -> str:
    """A page without its code."""
    return re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(), flags=re.DOTALL)


def anchors(page: Path) -> set[str]:
    """What a link may name in a page: its headings, as GitHub makes anchors of them."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_to_a_file_and_a_heading_that_exist(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if target.startswith(("http://", "https://")):
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        assert file.exists(), target
        assert not anchor or anchor in anchors(file), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_table_has_an_empty_line_before_it_without_which_it_is_no_table(page: Path) -> None:
    lines = re.sub(r"```.*?```|<!--.*?-->", "", page.read_text(), flags=re.DOTALL).splitlines()
    begins = [k for k, line in enumerate(lines) if line.startswith("|") and k and not lines[k - 1].startswith("|")]
    assert [lines[k] for k in begins if lines[k - 1].strip()] == []


@pytest.mark.parametrize("name", ["ros2_control", "learning", "simulink"])
def test_page_for_who_has_something_already_has_at_most_400_words(name: str) -> None:
    assert len((ROOT / "docs" / f"{name}.md").read_text().split()) <= 400


def test_every_page_is_reached_from_the_readme() -> None:
    reached, waiting = set(), [ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        if page in reached or not page.is_file():
            continue
        reached.add(page)
        links = re.findall(r"\]\(([^)\s#]+\.md)(?:#[^)]*)?\)", page.read_text())
        waiting += [(page.parent / link).resolve() for link in links]
    assert set(PAGES) <= reached


@pytest.mark.parametrize("word", ["friction bound", "total variation", "round trip", "trajectory", "drive", "score"])
def test_glossary_has_a_row_for_each_word_of_the_score(word: str) -> None:
    (row,) = re.findall(rf"^\| {word} \| (.+) \|$", GLOSSARY, re.MULTILINE)
    assert len(row.split()) > 5


def test_names_of_the_glossary_are_names_of_the_software() -> None:
    known = {spec.name for spec in specifications(SimParameters)}
    known |= {each.name for each in fields(ScoreSummary)} | {each.name for each in fields(Simulation)}
    known |= {"open_loop", "sgn", "tanh", "PiezoDrive", "Measurement", "alpha", "code", "valid"}
    known |= {"FAULT", "step"}  # a state of InstrumentStatus.msg, a service of the simulator
    assert set(re.findall(r"`([^`]+)`", GLOSSARY)) <= known


WALKS = (ROOT / "docs" / "architecture.md").read_text().partition("## Three walks")[2].partition("\n## ")[0]


def defined(source: Path) -> set[str]:
    """Functions, classes and methods of a module, by qualified name."""
    found: set[str] = set()
    waiting: list[tuple[str, ast.AST]] = [("", ast.parse(source.read_text()))]
    while waiting:
        prefix, node = waiting.pop()
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef | ast.ClassDef):
                found.add(prefix + child.name)
                waiting.append((f"{prefix}{child.name}.", child))
    return found


@pytest.mark.parametrize(("name", "file"), sorted(set(re.findall(r"\[`([\w.]+)`\]\(([^)]+\.py)\)", WALKS))))
def test_functions_of_the_walks_exist(name: str, file: str) -> None:
    assert name in defined((ROOT / "docs" / file).resolve())


def test_each_walk_has_several_steps() -> None:
    walks = WALKS.split("\n### ")[1:]
    assert [walk.split(":")[0] for walk in walks] == ["A drive", "A pixel", "A parameter"]
    assert all(len(re.findall(r"^\d+\. ", walk, re.MULTILINE)) >= 5 for walk in walks)
