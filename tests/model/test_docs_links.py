"""Claims about the prose: links lead somewhere, the glossary explains the words that the software uses."""

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
