"""The table of wrong models as a picture, a panel a law, and as the table of docs/predictive.md."""

import math
from collections.abc import Sequence
from statistics import median
from typing import Any

import matplotlib

matplotlib.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.figure import Figure

_LEAST, _MOST = 1e-3, 200.0
"""Errors [%] at which the scale of the picture ends."""
_MARKERS = "os^"
Rows = Sequence[dict[str, Any]]
"""Rows of `afm_model.studies.wrong_models`."""


def _by(rows: Rows, name: str) -> dict[str, list[dict[str, Any]]]:
    """The rows of each law, case or rate, in their order."""
    return {key: [row for row in rows if row[name] == key] for key in dict.fromkeys(row[name] for row in rows)}


def _parts(rows: Rows) -> list[str]:
    """Of one law: its name, median, worst case, number of lost runs."""
    worst = max(rows, key=lambda row: row["worst"])
    return [
        rows[0]["law"],
        f"median {_percent(median(row['third'] for row in rows))}",
        f"worst {_percent(worst['worst'])} ({worst['case']}, {worst['rate']})",
        f"{sum(bool(row['lost']) for row in rows)} of {len(rows)} lost",
    ]


def _percent(error: float) -> str:
    return f"{_number(error)} %" if math.isfinite(error) else "diverged"


def _number(error: float) -> str:
    return f"{error:.2g}" if error < 99.5 else f"{error:.0f}"


def robust_line(row: dict[str, Any]) -> str:
    """One row: error in the first and the third period, of several runs the median and the worst; why it is lost."""
    errors = f"{_percent(row['first'])} in the first period, {_percent(row['third'])} in the third"
    if row["worst"] != row["third"]:
        errors += f", at worst {_percent(row['worst'])}"
    if row["lost"]:
        errors += f"; lost: {row['lost']}"
    return f"{row['law']}: {row['rate']}, {row['case']}: {errors}"


def robust_summary(rows: Rows) -> str:
    """Median, worst case and number of lost runs of one law, in a line."""
    law, *parts = _parts(rows)
    return f"{law}: {', '.join(parts)}"


def robust_picture(rows: Rows) -> Figure:
    """Error in the third period of every case, a colour a rate, lost ones as crosses; hollow: in the first one."""
    laws, cases = _by(rows, "law"), list(_by(rows, "case"))
    figure, panels = plt.subplots(
        1,
        len(laws),
        figsize=(3.0 + 3.4 * len(laws), 1.8 + 0.19 * len(cases)),
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    for panel, own in zip(panels[0], laws.values(), strict=True):
        for number, (rate, runs) in enumerate(_by(own, "rate").items()):
            look = {"color": f"C{number}", "ls": "", "ms": 4.5}
            places = {row["case"]: cases.index(row["case"]) + 0.22 * (number - 1) for row in runs}
            kept = [row for row in runs if not row["lost"]]
            lost = [row for row in runs if row["lost"]]
            shown = [min(max(row["third"], _LEAST), _MOST) for row in kept]
            where = [places[row["case"]] for row in kept]
            panel.plot(shown, where, _MARKERS[number % 3], label=rate, **look)
            first = [min(max(row["first"], _LEAST), _MOST) for row in kept]
            panel.plot(first, where, _MARKERS[number % 3], mfc="none", alpha=0.35, **look)
            panel.plot([_MOST] * len(lost), [places[row["case"]] for row in lost], "x", mew=1.6, **look)
            middle = median(row["third"] for row in runs)
            if _LEAST < middle < _MOST:
                panel.axvline(middle, color=f"C{number}", lw=0.8, ls="--")
        panel.set_title("\n".join(_parts(own)), fontsize=8)
        panel.axvline(100.0, color="0.4", lw=0.8)
        panel.set(xscale="log", xlim=(0.7 * _LEAST, 1.5 * _MOST), xlabel="error [% of amplitude]")
        panel.grid(alpha=0.25)
    panels[0][0].set_yticks(range(len(cases)), cases, fontsize=7)
    panels[0][0].set_ylim(len(cases) - 0.4, -0.6)
    figure.legend(*panels[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    title = "the law is given a wrong model; hollow: first period; dashed: median of the third; crosses: lost"
    figure.suptitle(title, fontsize=9)
    return figure


def robust_table(rows: Rows) -> str:
    """Tabulate the error in the first -> the third period: a row a case, a column a rate; in a cell the laws in order.

    Of several runs the medians; in brackets the worst one in the third period.
    """
    rates = list(_by(rows, "rate"))
    lines = [f"| given or true | {' | '.join(rates)} |", "| --- |" + " --- |" * len(rates)]
    for case, runs in _by(rows, "case").items():
        cells = ["; ".join(map(_cell, of_rate)) for of_rate in _by(runs, "rate").values()]
        lines.append(f"| {case} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _cell(row: dict[str, Any]) -> str:
    if not math.isfinite(row["third"]):
        return "-"
    third, worst = _number(row["third"]), _number(row["worst"])
    return f"{_number(row['first'])}→{third}{f' ({worst})' if worst != third else ''}{'!' if row['lost'] else ''}"


def robust_laws(rows: Rows) -> str:
    """A row a law: medians of the first -> the third period at each rate, the worst run of all, what is lost."""
    rates = list(_by(rows, "rate"))
    lines = [f"| law | {' | '.join(rates)} | worst [%] | lost |", "| --- |" + " --- |" * (len(rates) + 2)]
    for law, own in _by(rows, "law").items():
        medians = [
            " → ".join(_number(median(row[period] for row in runs)) for period in ("first", "third"))
            for runs in _by(own, "rate").values()
        ]
        worst = max(own, key=lambda row: row["worst"])
        found = _number(worst["worst"]) if math.isfinite(worst["worst"]) else "diverged"
        lost = sum(bool(row["lost"]) for row in own)
        lines.append(
            f"| `{law}` | {' | '.join(medians)} | {found} ({worst['case']}, {worst['rate']}) | {lost} of {len(own)} |"
        )
    return "\n".join(lines) + "\n"
