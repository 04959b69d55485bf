"""The tables of docs/laws.md and docs/predictive.md: each stands in the page that has its mark."""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from make_docs import between_marks

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGES = (DOCS / "laws.md", DOCS / "predictive.md")


def table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """In Markdown."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *lines))


def marks(page: Path) -> list[str]:
    """Names of the tables of a page."""
    return re.findall(r"^<!-- (?!end)(.*) -->$", page.read_text(), re.MULTILINE)


def page_of(mark: str) -> Path:
    """The page that holds the table of this name."""
    found = [page for page in PAGES if mark in marks(page)]
    if len(found) != 1:
        raise ValueError(f"the mark <!-- {mark} --> should be in one of {', '.join(page.name for page in PAGES)}")
    return found[0]


def put(mark: str, text: str) -> None:
    """Put a table into its page."""
    page = page_of(mark)
    page.write_text(between_marks(page.read_text(), mark, text))


def show(tables: Iterable[tuple[str, str]], write: bool) -> None:
    """Print tables, given by mark and text, as they are made; `write`: and put each into its page."""
    for mark, text in tables:
        print(text, flush=True)
        if write:
            put(mark, text)
