"""`make bench`: each figure beside its floor, measured in the same run. Prints everything, asserts nothing.

Only ratios are worth comparing between machines; on a shared one, only those of the same run.
"""

import argparse
import json
import os
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

import comparison
import kernel
import lanes
import lever
import loops
import machine
import realtime
import startup
import sweep
import tapping
import verbs
import wire
from rich.console import Console
from rich.markup import escape
from rich.table import Table

PERIODS = (2e-6, 1e-5, 2e-5, 5e-5)
PARTS = (
    *("kernel", "lanes", "lever", "tapping", "composed", "processes", "recorder", "realtime", "startup"),
    *("sweep", "comparison", "verbs"),
)


class Report:
    """The table, row by row as it is measured, and the same as data."""

    def __init__(self) -> None:
        self.table = Table("", "measured", "floor", "of the floor", title="Bench", title_justify="left")
        self.data: dict[str, Any] = {}
        self._console = Console(stderr=True)

    def begin(self, text: str) -> None:
        """Tell what is being measured now."""
        self._console.print(f"[dim]measuring {text} ...[/dim]")

    def add(self, name: str, measured: str, floor: str = "", ratio: float | None = None) -> None:
        """One row."""
        # Units in brackets would be taken for markup.
        self.table.add_row(escape(name), measured, floor, "" if ratio is None else f"{ratio:.2f}")


def bench_kernel(report: Report, folder: Path) -> None:
    """The plant's step against C."""
    report.begin("the plant's kernel")
    figures = report.data["kernel"] = kernel.measure(folder)
    if "reason" in figures:
        report.add("plant, ns a step", figures["reason"])
        return
    numba = figures["numba"]
    for name in ("c", "c_native"):
        c = figures[name]
        report.add(
            f"plant, ns a step (floor: C, {c['flags']})",
            f"{numba['ns_per_step']:.0f}",
            f"{c['ns_per_step']:.0f}",
            c["ratio"],
        )
    report.add("plant, times real time at a step of 1 us", f"{numba['real_time_factor']:.1f}")


def bench_lanes(report: Report, folder: Path) -> None:
    """The plant's step for many instruments."""
    report.begin("the plant in lanes")
    figures = report.data["lanes"] = lanes.measure(folder)
    for name, text in (("scalar", "one by one"), ("c_native", "in C, one by one")):
        if name in figures:
            report.add(
                f"plant in lanes, ns a step and instrument (floor: {text})",
                f"{figures['lanes']:.1f}",
                f"{figures[name]:.0f}",
                figures["lanes"] / figures[name],
            )
    lever_kernel = figures["lever_kernel"] = lanes.measure_lever()
    report.add(
        f"plant lever in lanes, {lever_kernel['left']:.1%} of the steps left, ns a step (floor: one by one)",
        f"{lever_kernel['lanes']:.0f}",
        f"{lever_kernel['scalar']:.0f}",
        lever_kernel["lanes"] / lever_kernel["scalar"],
    )
    for kind, times in lanes.measure_loops().items():
        figures[kind] = times
        report.add(
            f"runs at 50 us with {kind} in lanes, ns a step (floor: one by one)",
            f"{times['lanes']:.0f}",
            f"{times['scalar']:.0f}",
            times["lanes"] / times["scalar"],
        )


def bench_lever(report: Report) -> None:
    """The plant lever with each preset, whole runs."""
    report.begin("the plant lever")
    figures = report.data["lever"] = lever.measure()
    for name, row in figures.items():
        report.add(f"lever, {name}: ns a step", f"{row['ns_per_step']:.0f}")
        report.add("  times real time", f"{row['real_time_factor']:.2g}")


def bench_tapping(report: Report) -> None:
    """A tip that taps, with the drive resolved and averaged over the cycle."""
    report.begin("a tip that taps")
    figures = report.data["tapping"] = tapping.measure()
    resolved = next(iter(figures.values()))["real_time_factor"]
    for name, row in figures.items():
        factor = row["real_time_factor"]
        report.add(
            f"tapping at 77 kHz, {name}, times real time (floor: resolved)",
            f"{factor:.3g}",
            f"{resolved:.3g}",
            factor / resolved,
        )


def bench_composed(report: Report, folder: Path, ticks: int) -> None:
    """Simulator and controller in one process. Floor and loop take turns."""
    report.begin("the loop in one process")
    floors, runs = [], []
    for _ in range(3):
        floors.append(wire.measure(folder, "one_process"))
        runs.append(loops.lockstep(folder, PERIODS[0], ticks, composed=True))
    others = [loops.lockstep(folder, period, ticks // 4, composed=True) for period in PERIODS[1:]]
    floor = statistics.median(f["per_second"] for f in floors)
    best = statistics.median(f["per_second_handles_entered_once"] for f in floors)
    rate = statistics.median(r["ticks_per_second"] for r in runs)
    report.data["composed"] = {"floors": floors, "lockstep": runs, "periods": others}
    report.add("one process, ticks/s at 2 us (floor: bare ping-pong)", f"{rate:.0f}", f"{floor:.0f}", rate / floor)
    # On a busy machine this is the figure to compare.
    floor_cpu = statistics.median(f["cpu_s"] for f in floors)
    cpu = statistics.median(r["cpu_s_per_tick"] for r in runs)
    report.add("  us of processor time a tick", f"{cpu * 1e6:.1f}", f"{floor_cpu * 1e6:.1f}", floor_cpu / cpu)
    report.add("  against handles entered once", f"{rate:.0f}", f"{best:.0f}", rate / best)
    for run in (runs[-1], *others):
        period = run["control_period_s"]
        report.add(
            f"  real-time factor, control period {period * 1e6:g} us",
            f"{run['real_time_factor']:.3g}",
            f"{best * period:.3g}",
            run["real_time_factor"] / (best * period),
        )


def bench_processes(report: Report, folder: Path, ticks: int) -> None:
    """Simulator and controller as processes."""
    report.begin("the loop between two processes")
    floors, runs = [], []
    for _ in range(3):
        floors.append(wire.measure(folder, "two_processes"))
        runs.append(loops.lockstep(folder, PERIODS[0], ticks // 4, composed=False))
    floor = statistics.median(f["per_second"] for f in floors)
    rate = statistics.median(r["ticks_per_second"] for r in runs)
    report.data["processes"] = {"floors": floors, "lockstep": runs}
    report.add("two processes, ticks/s at 2 us (floor: bare ping-pong)", f"{rate:.0f}", f"{floor:.0f}", rate / floor)
    for name, value in runs[-1]["resident_mb"].items():
        report.add(f"  resident memory, {name} [MB]", f"{value:.0f}")


def bench_recorder(report: Report, folder: Path, ticks: int) -> None:
    """What recording costs the loop, and the recorder itself."""
    report.begin("the recorder")
    pairs = []
    for _ in range(3):
        without = loops.lockstep(folder, PERIODS[0], ticks, composed=True)
        pairs.append((without, loops.lockstep(folder, PERIODS[0], ticks, composed=True, recorded=True)))
    idle = loops.lockstep(folder, PERIODS[0], 500, composed=True, recorded=True)
    off = statistics.median(without["ticks_per_second"] for without, _ in pairs)
    on = statistics.median(recorded["ticks_per_second"] for _, recorded in pairs)
    # Starting costs the same whatever is recorded.
    cpu = statistics.median(recorded["cpu_s"] for _, recorded in pairs) - idle["cpu_s"]
    samples = ticks * round(PERIODS[0] / 1e-6) * 4
    report.data["recorder"] = {
        "pairs": pairs,
        "cpu_s_per_sample": cpu / samples,
        "same_trajectory": len({run["trajectory_sha256"] for pair in pairs for run in pair}) == 1,
    }
    report.add("one process with a recorder, ticks/s (floor: without)", f"{on:.0f}", f"{off:.0f}", on / off)
    report.add("  recorder, ns of processor time a sample", f"{cpu / samples * 1e9:.0f}")
    report.add("  recorder, resident memory [MB]", f"{pairs[-1][1]['resident_mb']['recorder']:.0f}")


def bench_realtime(report: Report, folder: Path, seconds: float) -> None:
    """Lateness at 1 kHz."""
    report.begin(f"realtime at 1 kHz for {seconds:g} s, twice")
    rows = report.data["realtime"] = realtime.measure(folder, seconds)
    for row in rows:
        c = row["c"]
        kind = "SCHED_FIFO, locked, polling" if row["privileged"] else "ordinary scheduling"
        report.add(
            f"realtime at 1 kHz, {kind}: periods missed", f"{row['periods_missed']}", f"{c['missed']}" if c else ""
        )
        for i, name in enumerate(("p50", "p99", "p99.9", "max")):
            report.add(
                f"  lateness {name} [us] (floor: a loop in C)",
                f"{row['lateness_s'][i] * 1e6:.1f}",
                f"{c['lateness_s'][i] * 1e6:.1f}" if c else "",
            )


def bench_startup(report: Report, folder: Path) -> None:
    """Start of a node."""
    report.begin("start and memory of a node")
    figures = report.data["startup"] = startup.measure(folder)
    ours, bare = figures["simulator"], figures["bare"]
    report.add(
        "simulator, start to first message [s] (floor: an empty node)",
        f"{ours['start_s']:.2f}",
        f"{bare['start_s']:.2f}",
        ours["start_s"] / bare["start_s"],
    )
    report.add(
        "  resident memory [MB]",
        f"{ours['resident_mb']:.0f}",
        f"{bare['resident_mb']:.0f}",
        ours["resident_mb"] / bare["resident_mb"],
    )


def bench_sweep(report: Report) -> None:
    """Many instruments."""
    report.begin("a sweep")
    report.data["sweep"] = figures = sweep.measure()
    for name, row in figures["rows"].items():
        report.add(f"sweep, {name} (floor: the kernel alone)", row["measured"], row["floor"], row["ratio"])


def bench_comparison(report: Report) -> None:
    """Laws side by side."""
    report.begin("a comparison")
    figures = report.data["comparison"] = comparison.measure()
    runs, seconds, linear = figures["runs"], figures["cpu_s"], figures["linear_s"]
    report.add(f"a comparison, {runs} runs: processor time [s]", f"{seconds:.1f}")
    report.add("  of it linear models", f"{linear:.1f}")


def bench_verbs(report: Report, folder: Path) -> None:
    """A scan over topics."""
    report.begin("a scan over topics")
    figures = report.data["verbs"] = verbs.measure(folder)
    for name, text in (("cpu_s", "processor time of the simulator"), ("wall_s", "wall time")):
        over, inside = figures[name]["over_topics"], figures[name]["in_process"]
        report.add(f"a scan over topics, {text} [s] (floor: in process)", f"{over:.2f}", f"{inside:.2f}", over / inside)
    for name, row in figures["answers"].items():
        times = ", ".join(f"{row[f'accepted_{which}_s'] * 1e3:.1f}" for which in ("p50", "p99", "max"))
        report.add(f"a goal, sent to accepted, loop at full speed, {name}: p50, p99, max [ms]", times)
        report.add("  to its result: p50 [ms]", f"{row['result_p50_s'] * 1e3:.1f}")


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="make bench", description=__doc__)
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}; all if none is named")
    parser.add_argument("--out", type=Path, default=Path("out/bench.json"), help="file of the figures")
    parser.add_argument("--ticks", type=int, default=100_000, help="control ticks of a lockstep run")
    parser.add_argument("--seconds", type=float, default=60.0, help="wall time of a realtime run")
    arguments = parser.parse_args()
    unknown = set(arguments.parts) - set(PARTS)
    if unknown:
        parser.error(f"unknown part {', '.join(sorted(unknown))}: there are {', '.join(PARTS)}")
    loops.domain()
    report = Report()
    report.data["machine"] = machine.facts()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        parts = {
            "kernel": lambda: bench_kernel(report, folder),
            "lanes": lambda: bench_lanes(report, folder),
            "lever": lambda: bench_lever(report),
            "tapping": lambda: bench_tapping(report),
            "composed": lambda: bench_composed(report, folder, arguments.ticks),
            "processes": lambda: bench_processes(report, folder, arguments.ticks),
            "recorder": lambda: bench_recorder(report, folder, arguments.ticks),
            "realtime": lambda: bench_realtime(report, folder, arguments.seconds),
            "startup": lambda: bench_startup(report, folder),
            "sweep": lambda: bench_sweep(report),
            "comparison": lambda: bench_comparison(report),
            "verbs": lambda: bench_verbs(report, folder),
        }
        for part in arguments.parts or PARTS:
            parts[part]()
    report.data["machine"]["load_at_end"] = os.getloadavg()[0]
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(json.dumps(report.data, indent=2) + "\n")
    facts = report.data["machine"]
    console = Console(width=None if Console().is_terminal else 120)
    console.print(report.table)
    console.print(
        f"{facts['processor']}, {facts['cores']} cores, Python {facts['python']}, ROS 2 {facts['ros']}; "
        f"load {facts['load_at_begin']:.2f} at begin, {facts['load_at_end']:.2f} at end. Figures: {arguments.out}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
