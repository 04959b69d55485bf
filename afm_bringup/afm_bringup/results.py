"""What a session leaves behind: scorecard and overview picture."""

import dataclasses
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from afm_msgs.msg import InstrumentStatus, Score
from matplotlib import pyplot as plt
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from afm_model import Scenario, ScoreSummary
from afm_model.scorecard import AXES, number
from afm_model.scorecard import scorecard as scored
from afm_recorder_node.reader import Recording

# A long noisy curve is more than Agg can fill in one piece.
plt.rcParams["agg.path.chunksize"] = 10_000

_ABOVE: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "ncols": 4,
    "fontsize": "small",
    "frameon": False,
}
"""A legend beside the title, where it hides nothing."""
_PERCENTILES = ("p50", "p99", "p99_9", "max")


def scorecard(scenario: Scenario, controller: str, score: Score, status: InstrumentStatus) -> dict[str, Any]:
    """The scorecard as plain values, SI units but for the round trip; None where there is nothing to score."""
    return {
        "scenario": scenario.name,
        "controller": controller,
        "plant": status.plant,
        "mode": status.mode,
        "control_period_s": status.control_period,
        "simulated_s": score.simulated,
        "wall_s": round(score.wall, 3),
        "real_time_factor": number(score.simulated / score.wall if score.wall > 0.0 else math.nan),
        "ticks": status.ticks,
        "drives_lost": status.drives_lost,
        "drives_refused": status.drives_refused,
        "scored_from_s": score.start,
        **scored(_summary(score)),
        "round_trip_us": _microseconds(score.round_trip),
        "realtime": {
            "late_ticks": score.late_ticks,
            "periods_missed": score.periods_missed,
            "ticks_retracted": score.ticks_retracted,
            "lateness_us": _microseconds(score.lateness),
            "command_age_us": _microseconds(score.command_age),
        }
        if status.mode == "realtime"
        else None,
        "trajectory_sha256": score.trajectory_sha256,
    }


def _summary(score: Score) -> ScoreSummary:
    """The scored part of the message."""
    return ScoreSummary(**{each.name: getattr(score, each.name) for each in dataclasses.fields(ScoreSummary)})


def _microseconds(times: Sequence[float]) -> dict[str, float | None]:
    """Median, percentiles and largest of wall times [s]."""
    return {name: number(value * 1e6) for name, value in zip(_PERCENTILES, times, strict=True)}


def write_scorecard(card: dict[str, Any], path: Path) -> None:
    """Write the scorecard as JSON."""
    path.write_text(json.dumps(card, indent=2) + "\n")


def print_scorecard(card: dict[str, Any], title: str) -> None:
    """Print the scorecard as a table."""
    table = Table(title=escape(title), show_header=True, title_justify="left")
    table.add_column("")
    for heading in ("x", "y", "z (tip)"):
        table.add_column(heading, justify="right")

    def add(name: str, *values: str) -> None:
        # Units in brackets would be taken for markup.
        table.add_row(escape(name), *values)

    tracking = card["tracking"]
    add("tracking error, rms [nm]", *(_show(tracking[a]["rms_m"], 1e9) for a in AXES))
    add("tracking error, max [nm]", *(_show(tracking[a]["max_m"], 1e9) for a in AXES))
    add("  in % of amplitude (z: of the sample's)", *(_show(tracking[a]["max_percent"]) for a in AXES))
    add("largest excursion [nm]", *(_show(card["extent_m"][a], 1e9) for a in AXES))
    variation = card["drive_total_variation_per_s"]
    add("drive, total variation [V/s]", *(_show(variation[a]) for a in AXES))
    facts = Table(show_header=False, box=None)
    stick, trip = card["stick"], card["round_trip_us"]
    friction, normal = card["friction_n"], card["normal_force_n"]
    for name, value in (
        ("plant, controller, mode", f"{card['plant']}, {card['controller']}, {card['mode']}"),
        ("stick phases, part of the time", f"{stick['phases']}, {_show(stick['time_fraction'], 100)} %"),
        ("friction bound [nN]", f"{_show(friction['min'], 1e9)} to {_show(friction['max'], 1e9)}"),
        ("normal force [nN]", f"{_show(normal['min'], 1e9)} to {_show(normal['max'], 1e9)}"),
        ("in contact, part of the time", f"{_show(card['contact_fraction'], 100)} %"),
        ("control ticks, drives lost, refused", f"{card['ticks']}, {card['drives_lost']}, {card['drives_refused']}"),
        ("simulated, wall time [s]", f"{card['simulated_s']:.4g}, {card['wall_s']:.4g}"),
        ("round trip p50, p99, p99.9, max [us]", ", ".join(map(_show, trip.values()))),
        *_realtime_facts(card["realtime"]),
        ("trajectory", card["trajectory_sha256"][:16] + "..."),
    ):
        facts.add_row(escape(name), escape(value))
    console = Console(width=None if Console().is_terminal else 100)
    console.print(table)
    console.print(facts)
    if card["contact_fraction"] is None:
        console.print(
            f"Nothing scored: the run ends at {card['simulated_s']:.4g} s, "
            f"scoring begins at {card['scored_from_s']:.4g} s (score.start)."
        )


def _realtime_facts(realtime: dict[str, Any] | None) -> list[tuple[str, str]]:
    if realtime is None:
        return []
    return [
        (
            "late ticks, periods missed, ticks retracted",
            ", ".join(str(realtime[key]) for key in ("late_ticks", "periods_missed", "ticks_retracted")),
        ),
        *(
            (f"{name} p50, p99, p99.9, max [us]", ", ".join(map(_show, realtime[key].values())))
            for name, key in (("lateness", "lateness_us"), ("command age", "command_age_us"))
        ),
    ]


def _show(value: float | None, scale: float = 1.0) -> str:
    return "-" if value is None else f"{value * scale:.4g}"


def draw_overview(recording: Recording, title: str, path: Path) -> None:
    """Draw position and reference, error, drive, and lateral force against position."""
    figure, ((top_left, top_right), (low_left, low_right)) = plt.subplots(
        2, 2, figsize=(12.0, 7.5), layout="constrained"
    )
    figure.suptitle(title)
    t = recording.time_ticks * 1e3
    nm = 1e9
    for i, (axis, colour) in enumerate((("x", "C0"), ("y", "C1"))):
        top_left.plot(t, recording.position[:, i] * nm, colour, lw=1.8, ls=("-", "--")[i], label=axis)
        same = i == 1 and np.array_equal(recording.reference[:, 0], recording.reference[:, 1])
        if not same:
            top_left.plot(
                t, recording.reference[:, i] * nm, "k:", lw=1.0, label="reference" if i == 0 else "y reference"
            )
    top_left.set_title("scanner position", loc="left")
    top_left.set(xlabel="simulated time [ms]", ylabel="position [nm]")
    top_left.legend(**_ABOVE)
    # The tip's error is of another size: it has its own axis.
    right = top_right.twinx()
    lines = right.plot(t, recording.error[:, 2] * nm, "C2", lw=0.6, alpha=0.6, label="z (tip), right axis")
    for i, (axis, colour) in enumerate((("x", "C0"), ("y", "C1"))):
        lines += top_right.plot(t, recording.error[:, i] * nm, colour, lw=1.4, ls=("-", "--")[i], label=axis)
    top_right.set_title("tracking error", loc="left")
    top_right.set(xlabel="simulated time [ms]", ylabel="x, y [nm]")
    right.set_ylabel("z of the tip [nm]")
    right.legend(handles=[*lines[1:], lines[0]], **_ABOVE)
    for i, axis in enumerate(AXES):
        low_left.plot(t, recording.drive[:, i], f"C{i}", lw=0.9, label=axis)
    low_left.set_title("piezo drive", loc="left")
    low_left.set(xlabel="simulated time [ms]", ylabel="drive [V]")
    low_left.legend(**_ABOVE)
    force = np.interp(recording.time_ticks, recording.time_samples, recording.lateral_force)
    low_right.plot(recording.position[:, 0] * nm, force * nm, "C3", lw=0.8)
    low_right.set_title("friction loop", loc="left")
    low_right.set(xlabel="scanner position x [nm]", ylabel="lateral force, x component [nN]")
    for axes in (top_left, top_right, low_left, low_right):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)
    plt.close(figure)
