"""The scorecard of a session: as JSON, and as a table for a person."""

import dataclasses
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from afm_msgs.msg import InstrumentStatus, Percentiles, Score
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from afm_model import Scenario, ScoreSummary
from afm_model.instrument.score import RANGES, VECTORS
from afm_model.instrument.scorecard import AXES, number
from afm_model.instrument.scorecard import scorecard as scored

if TYPE_CHECKING:
    from afm_recorder_node.recording import Recording


def law_of(recording: "Recording", controller: str) -> dict[str, Any] | None:
    """Law and gains of our controller node as they were at the start of the recording, and what has changed since.

    Parameters
    ----------
    recording : Recording
    controller : str
        Full name of the node.

    Returns
    -------
    dict or None
        `parameters` by name and `changes`, each with its simulated time; None for a controller without such parameters.
    """
    name = controller.rpartition("/")[2]
    known = recording.parameters.get(name) or recording.parameters.get(controller) or {}
    parameters = {each: value for each, value in known.items() if each.startswith("law.")}
    changes = [
        {"time_s": change.time, "name": change.name, "old": change.old, "new": change.new}
        for change in recording.parameter_changes
        if change.node in (name, controller) and change.name.startswith("law.")
    ]
    return {"parameters": parameters, "changes": changes} if parameters else None


def kinds(law: dict[str, Any]) -> str:
    """The law, or those that were in force one after the other."""
    later = [str(each["new"]) for each in law["changes"] if each["name"] == "law.kind"]
    return " then ".join([str(law["parameters"]["law.kind"]), *later])


def scorecard(
    scenario: Scenario, controller: str, score: Score, status: InstrumentStatus, law: dict[str, Any] | None = None
) -> dict[str, Any]:
    """The scorecard as plain values, SI units but for the round trip; None where there is nothing to score.

    Parameters
    ----------
    scenario : Scenario
    controller : str
        Law of ours, or name of the node.
    score : Score
    status : InstrumentStatus
    law : dict, optional
        From `law_of`; None: not known.
    """
    return {
        "scenario": scenario.name,
        "controller": controller,
        "law": law,
        "valid": score.valid,
        "reason": score.reason,
        "warning": score.warning,
        "plant": status.plant,
        "mode": status.mode,
        "control_period_s": status.control_period,
        "simulated_s": score.simulated,
        "wall_s": round(score.wall, 3),
        "real_time_factor": number(score.simulated / score.wall if score.wall > 0.0 else math.nan),
        "ticks": status.ticks,
        "drives_lost": score.drives_lost,
        "horizon_ticks": score.horizon_ticks,
        "drives_refused": score.drives_refused,
        "drives_outdated": score.drives_outdated,
        "drives_ahead": score.drives_ahead,
        "drives_malformed": score.drives_malformed,
        "drives_clipped": score.drives_clipped,
        "drives_steep": score.drives_steep,
        "faults": list(score.faults),
        "withdrawals": score.withdrawals,
        "ticks_withdrawn": score.ticks_withdrawn,
        "scored_from_s": score.start,
        **scored(summary_of(score)),
        "round_trip_us": _microseconds(score.round_trip),
        "realtime": {
            "late_ticks": score.late_ticks,
            "periods_missed": score.periods_missed,
            "ticks_retracted": score.ticks_retracted,
            "retracted_fraction": number(score.retracted_fraction),
            "lateness_us": _microseconds(score.lateness),
            "command_age_us": _microseconds(score.command_age),
        }
        if status.mode == "realtime"
        else None,
        "trajectory_sha256": score.trajectory_sha256,
    }


def summary_of(score: Score) -> ScoreSummary:
    """The scored part of the message."""

    def value(name: str) -> Any:
        if name in VECTORS:
            return np.array([getattr(getattr(score, name), axis) for axis in AXES])
        if name in RANGES:
            return getattr(score, f"{name}_min"), getattr(score, f"{name}_max")
        return getattr(score, name)

    return ScoreSummary(**{each.name: value(each.name) for each in dataclasses.fields(ScoreSummary)})


def _microseconds(times: Percentiles) -> dict[str, float | None]:
    """Median, percentiles and largest of wall times [s]."""
    return {name: number(getattr(times, name) * 1e6) for name in times.get_fields_and_field_types()}


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
    add("position, max [nm]", *(_show(card["extent_m"][a], 1e9) for a in AXES))
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
        ("control ticks", str(card["ticks"])),
        (
            "drives lost, refused, outdated, ahead",
            ", ".join(str(card[f"drives_{which}"]) for which in ("lost", "refused", "outdated", "ahead")),
        ),
        *(
            [("drives malformed, clipped, too steep", ", ".join(map(str, odd)))]
            if any(odd := [card[f"drives_{which}"] for which in ("malformed", "clipped", "steep")])
            else []
        ),
        *([("faults", ", ".join(card["faults"]))] if card["faults"] else []),
        *([("ticks on a drive sent ahead", str(card["horizon_ticks"]))] if card["horizon_ticks"] else []),
        *(
            [("withdrawals, ticks withdrawn", f"{card['withdrawals']}, {card['ticks_withdrawn']}")]
            if card["withdrawals"]
            else []
        ),
        ("simulated, wall time [s]", f"{card['simulated_s']:.4g}, {card['wall_s']:.4g}"),
        ("real-time factor reached", _show(card["real_time_factor"])),
        ("round trip p50, p99, p99.9, max [us]", ", ".join(map(_show, trip.values()))),
        *_realtime_facts(card["realtime"]),
        ("trajectory", card["trajectory_sha256"][:16] + "..."),
    ):
        facts.add_row(escape(name), escape(value))
    console = Console(width=None if Console().is_terminal else 100)
    console.print(table)
    console.print(facts)
    for change in card["law"]["changes"] if card["law"] else ():
        console.print(f"At {change['time_s']:.6g} s {change['name']} changed from {change['old']} to {change['new']}.")
    if not card["valid"]:
        console.print(f"Not to be compared with other scores: {escape(card['reason'])}.")
    if card["warning"]:
        console.print(f"Warning: {escape(card['warning'])}.")
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
