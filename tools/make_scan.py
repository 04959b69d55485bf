"""Draw what hysteresis and creep make of an image: docs/figures/open_loop_scan.

python tools/make_scan.py            # some half minute
"""

import argparse
import sys
from pathlib import Path

from figures import scan, style
from figures.runs import ROOT


def main() -> int:
    """Draw it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "figures", help="folder to write to")
    parser.add_argument("--lines", type=int, default=32, help="lines of the image")
    arguments = parser.parse_args()
    style.use()
    style.save(scan.draw(arguments.lines), arguments.out, "open_loop_scan")
    return 0


if __name__ == "__main__":
    sys.exit(main())
