"""Check that messages and docstrings are written in plain words.

python tools/check_words.py          # each place that has another word, and what to write; exit code 1 if there is one
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLAIN = {
    r"anew": "again",
    r"nor": "and not, or",
    r"told|tells?": "given, reported, shows, warns",
    r"beside": "next to, as well as, in addition to",
    r"behind": "after (of time), a lag of (of a loop)",
    r"is none|are none": "is not a ..., does not exist",
    r"off by": "error of, differs by, has an offset of",
    r"of (?:its|their) own": "separate, (leave out)",
    r"likewise": "also, the same way",
    r"the like": "(name it)",
}
"""What is not written, and what is in its place."""
_WORDS = re.compile("|".join(rf"(\b(?:{words})\b)" for words in PLAIN), re.IGNORECASE)


def texts(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of each string with spaces in a module: messages, docstrings, descriptions."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield node.lineno, node.value


def found(source: str) -> Iterator[tuple[int, str, str]]:
    """Line, word and what to write in its place, of each word in a module that is not plain."""
    for line, text in texts(source):
        for match in _WORDS.finditer(text):
            yield line + text[: match.start()].count("\n"), match[0], list(PLAIN.values())[(match.lastindex or 1) - 1]


def main() -> int:
    count = 0
    for path in sorted(ROOT.glob("afm_*/afm_*/**/*.py")):
        for line, word, plain in found(path.read_text()):
            print(f"{path.relative_to(ROOT)}:{line}: {word!r}: write {plain}")
            count += 1
    return min(count, 1)


if __name__ == "__main__":
    sys.exit(main())
