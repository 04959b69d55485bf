"""Claims about tools/check_words.py: words that are not plain are found in messages and docstrings only."""

import runpy
from pathlib import Path

check = runpy.run_path(str(Path(__file__).parents[2] / "tools" / "check_words.py"))

LINES = [
    '"""What this tells."""',
    "",
    'told = {"told": 1}  # told',
    "",
    "",
    "def read(place):",
    '    """Read it.',
    "",
    "    Anew.",
    '    """',
    '    raise ValueError(f"{place} is none of its own: write it again")',
]


def test_words_of_messages_and_docstrings_are_found_with_their_line_but_not_those_of_names_and_comments():
    found = [(line, word) for line, word, _ in check["found"]("\n".join(LINES))]
    assert sorted(found) == [(1, "tells"), (9, "Anew"), (11, "is none"), (11, "of its own")]
