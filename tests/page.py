"""Pages of the documentation that a make target writes its figures into."""

from pathlib import Path


def write_between_marks(path: Path, mark: str, text: str) -> None:
    """Put `text` between `<!-- mark -->` and the next `<!-- end -->` of a page.

    Raises
    ------
    ValueError
        If the page has no such place.
    """
    page = path.read_text()
    before, begin, rest = page.partition(f"<!-- {mark} -->\n")
    _, end, after = rest.partition("<!-- end -->")
    if not begin or not end:
        raise ValueError(f"{path} has no place <!-- {mark} --> ... <!-- end -->")
    path.write_text(f"{before}{begin}{text}\n{end}{after}")
