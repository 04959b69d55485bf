"""A comparison as one page of HTML that contains its pictures."""

import base64
import io
import math
import textwrap
from html import escape
from typing import Any

import matplotlib

matplotlib.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from afm_model import Comparison
from afm_model.studies import CONDITIONS, RANKED, UNDER

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 72em; padding: 0 1em; color: #222; }
table { border-collapse: collapse; margin: 1em 0; font-variant-numeric: tabular-nums; }
th, td { padding: .25em .7em; border-bottom: 1px solid #ddd; text-align: right; vertical-align: top; }
th { border-bottom: 2px solid #888; }
td.text, th.text { text-align: left; }
tr.bad td { color: #a33; }
td small { color: #888; }
img { max-width: 100%; }
"""
_NAMES = {
    "error_max": "error, max [%]",
    "error_rms": "error, rms [%]",
    "chatter": "chatter",
    "energy": "energy [V²]",
    "tip_force": "normal load, max [nN]",
    "contact": "contact [%]",
    "margin": "margin",
    "z_rms": "z of the tip, rms [nm]",
}
_SCALES = {"tip_force": 1e9, "contact": 100.0, "z_rms": 1e9}
_TOP = 1000.0
"""Error [%] at which the scale of the picture ends."""
_LEGEND_WIDTH = 32
_MARKERS = "osD^vP*Xhp<>"


def page(comparison: Comparison) -> str:
    """The whole page."""
    figures = [errors_by_period(comparison), chatter_by_error(comparison)]
    pictures = "\n".join(f'<p><img alt="" src="data:image/svg+xml;base64,{_svg(figure)}"></p>' for figure in figures)
    varied = ", ".join(
        f"{name.replace('_', ' ')}: {', '.join(map(_condition, comparison.table[name].unique()))}"
        for name in CONDITIONS
    )
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Control laws compared</title><style>{_STYLE}</style></head><body>
<h1>Control laws compared</h1>
<p>{len(comparison.table)} runs. {escape(varied)}.</p>
<p>Every law has the same measurements, and the period and delay if it has parameters for them. The last column
lists its further knowledge. The error is that of the worse of x and y in percent of the amplitude; chatter is the total
variation of the drive over that of a smooth one; the margin is the smallest distance of the open loop from -1. Medians
over all runs; one that has an error in the list below counts as infinite. Small figures: the rank among all
laws.</p>
{_ranking(comparison)}
{pictures}
<details><summary>All runs</summary>
{_runs(comparison)}
</details>
</body></html>
"""


def _condition(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _number(value: Any, scale: float = 1.0) -> str:
    number = float(value) * scale
    return f"{number:.3g}" if math.isfinite(number) else ("∞" if number > 0.0 else "–")


def _ranking(comparison: Comparison) -> str:
    head = "".join(f"<th>{escape(_NAMES[name])}</th>" for name in RANKED)
    rows = []
    for row in comparison.ranking().to_dict("records"):
        cells = "".join(
            f"<td>{_number(row[name], _SCALES.get(name, 1.0))} <small>{row['rank_' + name]}</small></td>"
            for name in RANKED
        )
        rows.append(
            f'<tr><td class="text">{escape(row["law"])}</td><td>{row["finished"]} of {row["runs"]}</td>'
            f'<td>{100.0 * row["good"]:.0f} %</td>{cells}<td class="text">{escape(row["knowledge"])}</td></tr>'
        )
    return (
        f'<table><tr><th class="text">law</th><th>finished</th><th>under {UNDER:g} %</th>{head}'
        f'<th class="text">knowledge used</th></tr>{"".join(rows)}</table>'
    )


def _runs(comparison: Comparison) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in [*CONDITIONS, *_NAMES.values()])
    rows = []
    for row in comparison.table.to_dict("records"):
        failed = isinstance(row["error"], str)
        conditions = "".join(f"<td>{_condition(row[name])}</td>" for name in CONDITIONS)
        numbers = "".join(f"<td>{_number(row[name], _SCALES.get(name, 1.0))}</td>" for name in _NAMES)
        error = f'<td class="text">{escape(row["error"])}</td>' if failed else "<td></td>"
        kind = ' class="bad"' if failed else ""
        rows.append(f'<tr{kind}><td class="text">{escape(row["law"])}</td>{conditions}{numbers}{error}</tr>')
    return f'<table><tr><th class="text">law</th>{head}<th></th></tr>{"".join(rows)}</table>'


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    plt.close(figure)
    return base64.b64encode(buffer.getvalue().encode()).decode()


def _legend(label: str) -> str:
    """A label on several short lines: that of a node is a whole command. A dollar sign begins no formula."""
    return textwrap.fill(label, _LEGEND_WIDTH).replace("$", r"\$")


def _looks(comparison: Comparison) -> dict[str, dict[str, Any]]:
    """Colour and marker of each law."""
    return {
        each.label: {"color": f"C{i % 10}", "marker": _MARKERS[i % len(_MARKERS)], "label": _legend(each.label)}
        for i, each in enumerate(comparison.contenders)
    }


def errors_by_period(comparison: Comparison) -> Figure:
    """Error over the control period, a panel a delay; of the other conditions the first values."""
    table = comparison.table
    first = {name: table[name].iloc[0] for name in ("noise", "friction", "reference")}
    for name, value in first.items():
        table = table[table[name] == value]
    delays = sorted(table["delay_ticks"].unique())
    figure, axes = plt.subplots(
        1, len(delays), figsize=(1.5 + 3.6 * len(delays), 4.2), sharey=True, squeeze=False, layout="constrained"
    )
    for panel, delay in zip(axes[0], delays, strict=True):
        of_delay = table[table["delay_ticks"] == delay]
        for law, look in _looks(comparison).items():
            runs = of_delay[of_delay["law"] == law].sort_values("period")
            lost = runs["error"].notna()
            shown = runs["error_max"].mask(lost, _TOP).clip(upper=_TOP)
            panel.plot(1e6 * runs["period"], shown, lw=1.2, ms=5, **look)
            panel.plot(1e6 * runs["period"][lost], shown[lost], "x", color="k", ms=9, mew=1.5, zorder=3)
        panel.axhline(UNDER, color="0.6", lw=0.8, ls="--")
        panel.set(
            xscale="log",
            yscale="log",
            xlabel="control period [µs]",
            title=f"delay: {delay} control period{'s' if delay != 1 else ''}",
        )
        panel.set_ylim(top=1.6 * _TOP)
        panel.grid(alpha=0.25, which="major")
    axes[0][0].set_ylabel("error, max [% of amplitude]")
    conditions = f"reference {first['reference']} rad/s, friction {first['friction']:g}, noise {first['noise']:g}"
    figure.suptitle(f"{conditions}; crosses: not ranked", fontsize="small")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside right upper", frameon=False)
    return figure


def chatter_by_error(comparison: Comparison) -> Figure:
    """Chatter over error, and force on the tip over error, of all runs that finished."""
    figure, axes = plt.subplots(1, 2, figsize=(11.0, 4.2), sharex=True, layout="constrained")
    for law, look in _looks(comparison).items():
        runs = comparison.table[(comparison.table["law"] == law) & comparison.table["error"].isna()]
        for panel, name in zip(axes, ("chatter", "tip_force"), strict=True):
            panel.plot(runs["error_max"], _SCALES.get(name, 1.0) * runs[name], ls="", ms=5, alpha=0.7, **look)
    for panel, name in zip(axes, ("chatter", "tip_force"), strict=True):
        panel.axvline(UNDER, color="0.6", lw=0.8, ls="--")
        panel.set(xscale="log", yscale="log", xlabel="error, max [% of amplitude]", ylabel=_NAMES[name])
        panel.grid(alpha=0.25, which="major")
        if comparison.table["error"].notna().all():
            panel.set(xlim=(0.1 * UNDER, _TOP), ylim=(0.1, 10.0))  # a logarithmic axis of nothing has no limits
    figure.suptitle("all runs that finished", fontsize="small")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right upper", frameon=False)
    return figure
