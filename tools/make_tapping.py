"""Draw two materials by phase in both branches, and a step that is scanned too fast: docs/figures/tapping.

python tools/make_tapping.py            # some two minutes
"""

import argparse
import sys
from pathlib import Path

from figures import style, tapping
from figures.runs import ROOT


def main() -> int:
    """Draw it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "figures", help="folder to write to")
    parser.add_argument("--lines", type=int, default=24, help="lines of the images of phase")
    arguments = parser.parse_args()
    style.use()
    style.save(tapping.draw(arguments.lines), arguments.out, "tapping")
    return 0


if __name__ == "__main__":
    sys.exit(main())
