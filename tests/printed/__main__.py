"""`python tests/printed`: every block of every page, and what runs it."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from printed.plan import listing, not_run

print("\n".join([*listing(), "", *not_run()]))
