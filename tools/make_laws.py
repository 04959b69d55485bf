"""Make the tables of docs/laws.md and docs/predictive.md and the picture of wrong models; some minutes.

python tools/make_laws.py                 # print
python tools/make_laws.py --write         # and put them into their pages, and docs/figures/robust.png
python tools/make_laws.py laws asked      # some only
"""

import argparse
import math
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
import law_bounds
import law_noise
import measure_predictive
from laboratory import laboratory
from law_pages import DOCS, PAGES, marks, put, table

from afm_bringup.compare_robust import robust_laws, robust_picture, robust_table
from afm_model import SimParameters
from afm_model.core.registry import names
from afm_model.studies.contender import contender
from afm_model.studies.wrong_models import CASE, CASES, RATES, Case, mixed, run_case

PICTURE = DOCS / "figures" / "robust.png"
KNOWLEDGE = ("known", "observed", "learned")
"""What `predictive` knows of the surface: all, nothing, the line that it has been along."""
PREDICTIVE = tuple(f"predictive surface={surface}" for surface in KNOWLEDGE)
OTHERS = (
    *(name for name in names("law") if name not in ("open_loop", "chirp", "external", "pid", "load", "predictive")),
    "observer friction=learned",
    "pid slowness=0.15",
)
DRAWN = (PREDICTIVE[1], "observer friction=learned", "pid slowness=0.15")
"""Laws of the picture."""
Row = dict[str, Any]
RATE = {rate.title: rate for rate in RATES}
TITLES = tuple(RATE)

_MAIN = (
    "resonances",
    "resonance of x",
    "mass ratio",
    "sensitivity",
    "lateral gain",
    "lateral zero",
    "z sensor",
    "friction x",
    "hysteresis .5 %",
    "drift",
)
_MANY = "resonances, mass, sensitivity, lateral gain and zero, z sensor, friction, hysteresis .5 %, drift"
ASKED: tuple[tuple[str, tuple[str, ...], tuple[tuple[float, float, float], ...]], ...] = (
    ("the truth", ("the truth",), ((0.04, 0.1, 0.04), (0.4, 0.6, 0.4), (0.4, 16.0, 0.4))),
    (
        _MANY,
        tuple(case.title for case in CASES if case.title.startswith(_MAIN)),
        ((0.05, 0.3, 0.2), (0.3, 1.0, 0.5), (1.0, 8.0, 2.0)),
    ),
    ("hysteresis 5 %, creep 1.5 %", ("hysteresis 5 %, creep 1.5 %",), ((1.0,) * 3, (4.0,) * 3, (8.0,) * 3)),
    ("patches x .9", ("patches x .9",), ((5.0,) * 3, (20.0,) * 3, (30.0,) * 3)),
    ("triangle, corners told", ("triangle, corners told",), ((0.5,) * 3, (1.0,) * 3, (1.0,) * 3)),
    ("all", tuple(case.title for case in CASES), ((100.0,) * 3,) * 3),
)
"""Rows of the table of wrong models; largest error asked of them in the third period at each of RATES, with the surface
known, nothing known, the line learned [%]."""
_TAU = SimParameters().contact.tau
_DRIFT = "drift 1 nm/s: 7.5 %, which no sensor sees (table below)"
WHY: dict[tuple[str, str], str] = {
    (_MANY, "50 us + 1"): _DRIFT,
    (_MANY, "200 us + 1"): _DRIFT,
    (_MANY, "1 ms packets"): f"{_DRIFT}; friction x 2 over an unknown surface: 55 % (table below)",
    ("patches x .9", "200 us + 1"): "28 %: the edge (table below)",
    ("patches x .9", "1 ms packets"): "51 %: the edge (table below)",
}
"""Of what is not met, by rows and rate: the bound that forbids it."""


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


def cells(noise: float = 0.0) -> dict[tuple[str, str, str], Row]:
    """Rows of `predictive` by law, case and rate."""
    return {(row["law"], row["case"], row["rate"]): row for row in rows(PREDICTIVE, noise)}


def number(error: float) -> str:
    """Of percent."""
    return f"{error:.2g}" if error < 99.5 else f"{error:.0f}"


def laws() -> str:
    """Every law shipped over the wrong models."""
    return robust_laws(rows((*PREDICTIVE, *OTHERS))).rstrip()


def wrong() -> str:
    """`predictive` over the wrong models, its three kinds of knowledge one behind the other."""
    return robust_table(rows(PREDICTIVE)).rstrip()


def asked() -> str:
    """What was asked of `predictive`, and what its worst row reaches: the median of a row's runs, of all the worst."""
    found = cells()
    lines = []
    for title, cases, limits in ASKED:
        counted = "worst" if title == "all" else "third"
        for rate, most in zip((rate.title for rate in RATES), limits, strict=True):
            reached, met = [], True
            for law, limit in zip(PREDICTIVE, most, strict=True):
                errors = {case: found[law, case, rate][counted] for case in cases}
                worst = max(errors, key=lambda case: errors[case])
                over = sum(error > limit for error in errors.values())
                met &= not over
                shown = number(errors[worst]) if math.isfinite(errors[worst]) else "diverged"
                largest, more = number(found[law, worst, rate]["worst"]), ""
                if len(cases) > 1 and over:
                    more = f" ({worst}; {over} of {len(cases)} rows)"
                elif len(cases) == 1 and largest != shown:
                    more = f" ({largest})"
                reached.append((f"**{shown}**" if over else shown) + more)
            wanted = " / ".join(f"{limit:g}" for limit in (most if len(set(most)) > 1 else most[:1]))
            reason = "" if met else WHY.get((title, rate), "no bound known")
            lines.append([title, rate, wanted, " / ".join(reached), reason])
    return table(["rows", "rate", "asked [%]", "reached [%]", "not met: what forbids it"], lines)


def noise_limit(case: str, rate: str, knows: str, limit: float) -> float:
    """What is asked with positions alone and noise [%]: twice that without, and what noise and drift leave."""
    given = CASE[case]
    strength = float(given.true.get("contact.tau", _TAU)) / _TAU
    at = RATE[rate]
    drift = law_bounds.of_drift(float(given.true.get("drift.rate_x", 0.0)))
    # A surface that was told or learned at another place is not known.
    knows = "observed" if drift > 0.1 else knows
    left = law_noise.bound_of_noise(at.period, at.delay_ticks, strength, knows, at.packet > 1)
    return 2.0 * limit + left + drift


def _of_asked(errors: dict[str, float], asked: dict[str, float]) -> str:
    """Errors of some rows beside what is asked of them: those that have more, or the nearest one."""
    over = [case for case in errors if errors[case] > asked[case]]
    told = []
    for case in over or [max(errors, key=lambda case: errors[case] / asked[case])]:
        text = f"{number(errors[case])} of {number(asked[case])}"
        text = f"**{text}**" if over else text
        told.append(f"{text} ({case})" if len(errors) > 1 else text)
    return "; ".join(told)


def asked_noisy() -> str:
    """What was asked of `predictive` with noise, and what the medians of the runs are."""
    found = cells(1.0)
    lines = []
    for title, cases, limits in ASKED[:-1]:
        for rate, most in zip(TITLES, limits, strict=True):
            reached = []
            for law, knows, limit in zip(PREDICTIVE, KNOWLEDGE, most, strict=True):
                errors = {case: found[law, case, rate]["third"] for case in cases}
                asked = {case: noise_limit(case, rate, knows, limit) for case in cases}
                reached.append(_of_asked(errors, asked))
            lines.append([title, rate, *reached])
    return table(["rows", "rate", "surface known [%]", "nothing known [%]", "line learned [%]"], lines)


def noise() -> str:
    """`predictive` with positions alone and noise in every row."""
    found = rows(PREDICTIVE, 1.0)
    lines = []
    for rate in TITLES:
        of_rate = [[row for row in found if row["rate"] == rate and row["law"] == law] for law in PREDICTIVE]
        lines.append([f"{rate}, median", *(number(median(row["third"] for row in each)) for each in of_rate)])
        worst = [max(each, key=lambda row: row["worst"]) for each in of_rate]
        lines.append(["worst of 5 seeds", *(f"{number(row['worst'])} ({row['case']})" for row in worst)])
        lost = [[row["case"] for row in each if row["lost"]] for each in of_rate]
        lines.append(["lost", *(", ".join(each) or "none" for each in lost)])
    return table([f"over the {len(CASES)} rows [%]", "surface known", "nothing known", "learned"], lines)


DRAWS = 30
"""Of all numbers wrong at once."""
MIXED = (*PREDICTIVE, "observer friction=learned")


def all_wrong() -> str:
    """All numbers wrong at once: median, nine of ten and worst of the draws, each the median of its runs."""
    lines, cases = [], [mixed(seed) for seed in range(DRAWS)]
    with ProcessPoolExecutor() as pool:
        for level, rate in product((0.0, 1.0), TITLES):
            found = []
            for law in MIXED:
                drawn = list(pool.map(_row, product((law,), cases, (rate,), (level,)), chunksize=2))
                errors = sorted(row["third"] for row in drawn)
                lost = sum(bool(row["lost"]) for row in drawn)
                least = median(errors), errors[DRAWS * 9 // 10 - 1], errors[-1]
                shown = "; ".join(number(error) if math.isfinite(error) else "-" for error in least)
                found.append(shown + (f" ({lost} lost)" if lost else ""))
            lines.append([f"{rate}, noise" if level else rate, *found])
    return table([f"{DRAWS} draws [%]", "surface known", "nothing known", "learned", MIXED[-1]], lines)


NOISY = (
    "the truth",
    "resonance of x +2 %",
    "mass ratio +10 %",
    "lateral gain 0.9",
    "friction x 0.5",
    "friction x 1.5",
    "friction x 2",
    "height x 2",
    "patches x .9",
    "hysteresis .5 %",
    "hysteresis 5 %, creep 1.5 %",
    "creep 1.5 %",
    "crosstalk .02",
    "Lissajous 2:3",
    "along y alone",
)
"""Rows that are shown with noise."""


def noisy() -> str:
    """Some rows with positions alone and noise: the median of the runs of the three kinds of knowledge."""
    found = cells(1.0)
    lines = (
        [case, *("; ".join(number(found[law, case, rate]["third"]) for law in PREDICTIVE) for rate in TITLES)]
        for case in NOISY
    )
    return table(["third period [%]", *TITLES], lines)


@cache
def of_equations() -> dict[str, str]:
    """Tables that follow from the equations and the loop."""
    return law_bounds.with_loop() | law_noise.tables()


TABLES: dict[str, Callable[[], str]] = {
    "laws": laws,
    "laboratory": laboratory,
    "wrong": wrong,
    "asked": asked,
    "mixed": all_wrong,
    "noise": noise,
    "noisy": noisy,
    "asked with noise": asked_noisy,
}


def every() -> dict[str, Callable[[], str]]:
    """All tables by their marks in the pages."""
    measured = {
        f"predictive {name}": lambda make=make: "\n".join(make()) for name, make in measure_predictive.TABLES.items()
    }
    of_pages = [mark for page in PAGES for mark in marks(page) if mark.startswith("bound ")]
    bounds = {mark: lambda mark=mark: of_equations()[mark] for mark in of_pages}
    return {f"laws {name}": make for name, make in TABLES.items()} | measured | bounds


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
