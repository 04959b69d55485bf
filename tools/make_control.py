"""Draw what control does to an image, docs/figures/control, and write its table into docs/images.md.

python tools/make_control.py            # some minutes
"""

import argparse
import sys
from pathlib import Path

from figures import control, page, style
from figures.runs import ROOT

PAGE = ROOT / "docs" / "images.md"
ALSO = (("pid", "right"), ("load", "right"))
"""In the table only."""


def main() -> int:
    """Draw it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "figures", help="folder to write to")
    parser.add_argument("--lines", type=int, default=16, help="lines of an image")
    parser.add_argument("--page", type=Path, default=PAGE, help="page to write the table into")
    arguments = parser.parse_args()
    style.use()
    pictures = {case: control.scan(*case, arguments.lines) for case in (*control.CASES, *ALSO)}
    style.save(control.draw(pictures), arguments.out, "control")
    page.insert(arguments.page, "control", control.table(pictures))
    return 0


if __name__ == "__main__":
    sys.exit(main())
