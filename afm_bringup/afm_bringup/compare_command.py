"""`ros2 run afm_bringup compare`: laws side by side; a table, a ranking and a page of pictures."""

import argparse
import csv
from pathlib import Path

from afm_model import Comparison, ParameterError, ScenarioError, SweepError, compare
from afm_model.core.registry import names
from afm_model.studies import Contender, contender, wrong_models
from afm_model.studies.wrong_models import CASES, mixed

from .compare_page import page
from .compare_robust import robust_laws, robust_line, robust_picture, robust_summary, robust_table
from .domain import end
from .node_law import node_contender
from .scenario_input import read_scenario

CSV, LATEX, PAGE = "comparison.csv", "ranking.tex", "comparison.html"
ROBUST, ROBUST_TABLE, ROBUST_PICTURE = "wrong_models.csv", "wrong_models.md", "robust.png"
"""Files in the folder of the results."""
TUNED_PID = "pid slowness=0.1,0.15,0.25,0.5,1"
"""The PID of a comparison without LAW: the best closed-loop time constant of these over the same runs."""


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="compare",
        description="Run laws under every combination of the conditions given, and rank them: laws in process, nodes "
        "over topics in lockstep.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument(
        "laws",
        nargs="*",
        metavar="LAW",
        help="a law by its name, or module:NAME of a law or of a class of your own; with parameters in quotes: "
        "'tanh alpha=0.4', tuned over values: 'pid slowness=0.15,0.5,1'; without LAW and --node, all of this package",
    )
    parser.add_argument(
        "--node",
        action="append",
        default=[],
        metavar="COMMAND",
        help="command that starts a node as a law, in quotes; may be given several times",
    )
    parser.add_argument(
        "--no-ros-args", action="store_false", dest="ros_arguments", help="give COMMAND no arguments but its own"
    )
    parser.add_argument("--out", required=True, type=Path, help="folder for the results")
    parser.add_argument("--scenario", help="scenario with the common parameters of all runs")
    parser.add_argument("--periods", nargs="+", type=float, default=[5e-5, 2e-4], help="control periods [s]")
    parser.add_argument("--delays", nargs="+", type=int, default=[0, 1], help="delays in control periods")
    parser.add_argument(
        "--noise", nargs="+", type=float, default=[0.0], help="levels of noise, see docs/controllers.md"
    )
    parser.add_argument("--friction", nargs="+", type=float, default=[1.0], help="true friction over nominal friction")
    parser.add_argument(
        "--references", nargs="+", default=["sine 50"], metavar="'SHAPE OMEGA'", help="shape and frequency [rad/s]"
    )
    parser.add_argument("--cycles", type=float, default=1.5, help="length of a run in periods of the reference")
    parser.add_argument(
        "--robust",
        action="store_true",
        help="run the laws over the table of wrong models instead, docs/laws.md; of the other conditions one level of "
        "noise counts",
    )
    parser.add_argument(
        "--draws",
        type=int,
        default=10,
        metavar="N",
        help="with --robust: further rows in which all numbers are wrong at once, drawn at random",
    )
    parser.add_argument("--workers", type=int, help="processes; as many as there are processors if not given")
    return parser.parse_args()


def main() -> int:
    """Entry point; the exit code is 2 for arguments that are not allowed, 1 if the results cannot be written."""
    arguments = _arguments()
    try:
        scenario = read_scenario(arguments.scenario) if arguments.scenario else None
        nodes = [node_contender(each, scenario, ros_arguments=arguments.ros_arguments) for each in arguments.node]
        laws = arguments.laws
        if not laws and not nodes:
            laws = [name for name in names("law") if name not in ("open_loop", "chirp", "external", "pid")]
            laws += ["observer friction=learned", "pid" if arguments.robust else TUNED_PID]
        if arguments.robust:
            every = [*map(contender, laws), *nodes]
            return _robust(every, arguments.noise, arguments.draws, arguments.out)
        comparison = compare(
            [*laws, *nodes],
            scenario,
            periods=arguments.periods,
            delay_ticks=arguments.delays,
            noise=arguments.noise,
            friction=arguments.friction,
            references=arguments.references,
            cycles=arguments.cycles,
            workers=arguments.workers,
        )
    except (ParameterError, ScenarioError, SweepError) as error:
        return end(f"error: {error}", 2)
    except KeyboardInterrupt:
        return end("interrupted", 130)
    try:
        write(comparison, arguments.out)
    except OSError as error:
        return end(f"error: {arguments.out} cannot be written: {error.strerror}", 1)
    show = ["law", "runs", "finished", "good", "error_max", "z_rms", "chatter", "tip_force", "margin"]
    print(comparison.ranking()[show].to_string(index=False, float_format="%.3g"))
    for law in comparison.contenders:
        print(f"{law.label} is told: {law.knowledge}")
    print(f"{arguments.out / PAGE}, {CSV}, {LATEX}")
    return 0


def _robust(laws: list[Contender], noise: list[float], draws: int, folder: Path) -> int:
    """Print the table of wrong models law by law; write it as CSV, as the tables of docs/laws.md, and as a picture."""
    if len(noise) != 1:
        raise ParameterError(
            f"noise = {' '.join(f'{level:g}' for level in noise)} is not allowed with --robust: give one level"
        )
    if draws < 0:
        raise ParameterError(f"draws = {draws} is not allowed: it must be >= 0")
    cases = (*CASES, *map(mixed, range(draws)))
    rows = []
    for law in laws:
        own = []
        for row in wrong_models(law, cases=cases, noise=noise[0]):
            own.append(row)
            print(robust_line(row), flush=True)
        print(robust_summary(own))
        rows += own
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / ROBUST).open("w", newline="") as file:
            table = csv.DictWriter(file, rows[0])
            table.writeheader()
            table.writerows(rows)
        (folder / ROBUST_TABLE).write_text(f"{robust_laws(rows)}\n{robust_table(rows)}")
        robust_picture(rows).savefig(folder / ROBUST_PICTURE, dpi=80)
    except OSError as error:
        return end(f"error: {folder} cannot be written: {error.strerror}", 1)
    return 0


def write(comparison: Comparison, folder: Path) -> None:
    """Write table, ranking and page into a folder.

    Raises
    ------
    OSError
        If they cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    comparison.to_csv(folder / CSV)
    (folder / LATEX).write_text(comparison.to_latex())
    (folder / PAGE).write_text(page(comparison))
