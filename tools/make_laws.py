"""Make the tables of docs/laws.md and docs/predictive.md and the picture of wrong models; some minutes.

python tools/make_laws.py                 # print
python tools/make_laws.py --write         # and put them into their pages, and docs/figures/robust.png
python tools/make_laws.py laws wrong      # some only
"""

import argparse
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
import measure_predictive
from laboratory import laboratory
from law_pages import DOCS, put

from afm_bringup.compare_robust import robust_laws, robust_picture, robust_table
from afm_model.core.registry import names
from afm_model.studies.contender import contender
from afm_model.studies.wrong_models import CASES, RATES, Case, run_case

PICTURE = DOCS / "figures" / "robust.png"
KNOWLEDGE = ("known", "observed", "learned")
"""What `predictive` knows of the surface: all, nothing, the line that it has been along."""
PREDICTIVE = tuple(f"predictive surface={surface}" for surface in KNOWLEDGE)
PAPER = ("sgn", "tanh", "sgn_tracking", "tanh_tracking")
"""Laws that are lost in nearly all rows: a sentence of the page says so."""
LEFT_OUT = ("open_loop", "chirp", "external", "pid", "load", "predictive", *PAPER)
OTHERS = (
    *(name for name in names("law") if name not in LEFT_OUT),
    "observer friction=learned",
    "pid slowness=0.15",
)
DRAWN = (PREDICTIVE[1], "observer friction=learned", "pid slowness=0.15")
"""Laws of the picture."""
Row = dict[str, Any]
RATE = {rate.title: rate for rate in RATES}
TITLES = tuple(RATE)


def _row(of: tuple[str, Case, str, float]) -> Row:
    law, case, rate, noise = of
    at = RATE[rate]
    return {"law": law, "case": case.title, "rate": rate, **run_case(case, at, contender(law), noise)}


@cache
def rows(laws: tuple[str, ...], noise: float = 0.0, rates: tuple[str, ...] = TITLES) -> tuple[Row, ...]:
    """The table of wrong models of some laws, all cores."""
    asked = product(laws, CASES, rates, (noise,))
    with ProcessPoolExecutor() as pool:
        return tuple(pool.map(_row, asked, chunksize=4))


def laws() -> str:
    """Every law shipped over the wrong models."""
    return robust_laws(rows((*PREDICTIVE, *OTHERS))).rstrip()


def wrong() -> str:
    """`predictive` over the wrong models, its three kinds of knowledge one behind the other."""
    return robust_table(rows(PREDICTIVE)).rstrip()


TABLES: dict[str, Callable[[], str]] = {"laws": laws, "laboratory": laboratory, "wrong": wrong}


def every() -> dict[str, Callable[[], str]]:
    """All tables by their marks in the pages."""
    measured = {
        f"predictive {name}": lambda make=make: "\n".join(make()) for name, make in measure_predictive.TABLES.items()
    }
    return {f"laws {name}": make for name, make in TABLES.items()} | measured


def main() -> int:
    """Print or write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tables", nargs="*", help=f"all, or some of: {', '.join(every())} (or their last words)")
    parser.add_argument("--write", action="store_true", help="put them into their pages")
    arguments = parser.parse_args()
    chosen = {
        mark: make
        for mark, make in every().items()
        if not arguments.tables or {mark, mark.partition(" ")[2]} & set(arguments.tables)
    }
    if not chosen:
        parser.error(f"there are no such tables; there are {', '.join(every())}")
    for mark, make in chosen.items():
        text = make()
        print(f"{mark}\n{text}\n", flush=True)
        if arguments.write:
            put(mark, text)
    if arguments.write and "laws laws" in chosen:
        drawn = [row for row in rows((*PREDICTIVE, *OTHERS)) if row["law"] in DRAWN]
        robust_picture(drawn).savefig(PICTURE, dpi=80)
    return 0


if __name__ == "__main__":
    sys.exit(main())
