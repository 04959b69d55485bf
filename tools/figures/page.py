"""Tables inside a page of the documentation, between two comments that name them."""

from pathlib import Path


def insert(page: Path, name: str, lines: list[str]) -> None:
    """Replace what stands between `<!-- name -->` and `<!-- end -->`."""
    text = page.read_text()
    head, found, rest = text.partition(f"<!-- {name} -->\n")
    if not found or "<!-- end -->" not in rest:
        raise ValueError(f"{page} holds no place for the table {name}: <!-- {name} --> ... <!-- end -->")
    page.write_text(head + found + "\n".join(lines) + "\n<!-- end -->" + rest.partition("<!-- end -->")[2])


def read(page: Path, name: str) -> list[list[str]]:
    """Cells of the table `name`, row by row, without the line under the heading."""
    rest = page.read_text().partition(f"<!-- {name} -->\n")[2]
    lines = rest.partition("<!-- end -->")[0].strip().splitlines()
    return [[cell.strip() for cell in line.replace("\\|", "¦").strip("|").split("|")] for line in lines[:1] + lines[2:]]
