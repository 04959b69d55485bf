"""`ros2 run afm_bringup compare`: laws side by side; a table, a ranking and a page of pictures."""

import argparse
import csv
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from afm_model import Comparison, ParameterError, ScenarioError, SweepError, compare
from afm_model.core.errors import ResultFileError, reason
from afm_model.core.outputs import require_folder
from afm_model.core.registry import add_parts, names
from afm_model.studies import UNDER, Contender, contenders, wrong_models
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
_DEFAULTS: dict[str, Any] = {
    "periods": [5e-5, 2e-4],
    "delays": [0, 1],
    "friction": [1.0],
    "references": ["sine 50"],
    "cycles": 1.5,
    "scenario": None,
    "workers": None,
    "draws": 10,
}
"""Of options that count either with --robust or without; they are refused where they do not."""
_SHOWN = ["law", "runs", "finished", "good", "error_max", "z_rms", "chatter", "tip_force", "margin"]
_UNITS = (
    f"finished: runs that are ranked; good: part of the runs with an error_max of {UNDER:g} % at most; medians of the "
    "runs, error_max in % of the amplitude, z_rms in m, tip_force in N"
)


def _arguments() -> argparse.Namespace:
    """What is given, defaults filled in; `given`: the options of `_DEFAULTS` that are."""
    parser = argparse.ArgumentParser(
        prog="compare",
        description="Run laws under every combination of the conditions given, and rank them: laws in process, nodes "
        "over topics in lockstep.",
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
    parser.add_argument(
        "--noise", nargs="+", type=float, default=[0.0], help="levels of noise, see docs/controllers.md (default: 0)"
    )

    def add(name: str, help_text: str, **more: Any) -> None:
        # Absent if not given: a default would look like something that the user wants.
        default = _DEFAULTS[name]
        shown = " ".join(map(str, default)) if isinstance(default, list) else default
        told = help_text if default is None else f"{help_text} (default: {shown})"
        parser.add_argument(f"--{name}", default=argparse.SUPPRESS, help=told, **more)

    add("scenario", "scenario with the common parameters of all runs, and with those of nodes")
    add("periods", "control periods [s]", nargs="+", type=float)
    add("delays", "delays in control periods", nargs="+", type=int)
    add("friction", "true friction over nominal friction", nargs="+", type=float)
    add("references", "shape and frequency [rad/s]", nargs="+", metavar="'SHAPE OMEGA'")
    add("cycles", "length of a run in periods of the reference", type=float)
    parser.add_argument(
        "--robust",
        action="store_true",
        help="run the laws over the table of wrong models instead, docs/laws.md; of the other conditions one level of "
        "noise counts",
    )
    robust = "with --robust: further rows in which all numbers are wrong at once, drawn at random"
    add("draws", robust, type=int, metavar="N")
    add("workers", "processes; as many as there are processors if not given", type=int)
    add_parts(parser)
    parsed = vars(parser.parse_args())
    return argparse.Namespace(**(_DEFAULTS | parsed), given=[name for name in _DEFAULTS if name in parsed])


def _require_options_that_count(arguments: argparse.Namespace) -> None:
    """Raise ParameterError if an option is given that changes nothing."""
    if not arguments.robust:
        if "draws" in arguments.given:
            raise ParameterError(f"--draws {arguments.draws} is not allowed without --robust, whose rows it adds to")
        return
    # The table has its own conditions; a scenario still has the parameters of a node.
    allowed = ("draws", "scenario") if arguments.node else ("draws",)
    if refused := [f"--{name}" for name in arguments.given if name not in allowed]:
        raise ParameterError(
            f"{', '.join(refused)} is not allowed with --robust: the table of wrong models has fixed conditions; "
            f"--noise with one level, --draws and, with --node, --scenario are"
        )


def main() -> int:
    """Entry point; the exit code is 2 for arguments that are not allowed, 1 if the results cannot be written."""
    arguments = _arguments()
    try:
        _require_options_that_count(arguments)
        scenario = read_scenario(arguments.scenario, parts=arguments.parts) if arguments.scenario else None
        nodes = [node_contender(each, scenario, ros_arguments=arguments.ros_arguments) for each in arguments.node]
        laws = arguments.laws
        if not laws and not nodes:
            laws = [name for name in names("law") if name not in ("open_loop", "chirp", "external", "pid")]
            laws += ["observer friction=learned", "pid" if arguments.robust else TUNED_PID]
        require_folder(arguments.out)
        if arguments.robust:
            every = [*map(_untuned, laws), *nodes]
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
    except ResultFileError as error:
        return end(f"error: {error}", 1)
    except KeyboardInterrupt:
        return end("interrupted", 130)
    try:
        write(comparison, arguments.out)
    except OSError as error:
        return end(f"error: {arguments.out} cannot be written: {reason(error)}", 1)
    print(comparison.ranking()[_SHOWN].to_string(index=False, float_format="%.3g"))
    print(_UNITS)
    for line in not_ranked(comparison):
        print(line)
    for law in comparison.contenders:
        print(f"{law.label} is given: {law.knowledge}")
    print(f"{arguments.out / PAGE}, {CSV}, {LATEX}")
    return 0


def not_ranked(comparison: Comparison) -> Iterator[str]:
    """A line for each law with runs that are not ranked: how many, and the commonest reason."""
    for law in comparison.contenders:
        runs = comparison.table[comparison.table["law"] == law.label]
        reasons = Counter(each.removesuffix(": this run is not ranked") for each in runs["error"].dropna())
        if reasons:
            reason, times = reasons.most_common(1)[0]
            rest = f"; {reasons.total() - times} for other reasons" if len(reasons) > 1 else ""
            yield f"{law.label}: {reasons.total()} of {len(runs)} runs are not ranked: {reason}{rest}"


def _untuned(text: str) -> Contender:
    """A law of --robust; ParameterError if it has several values of a parameter."""
    made = contenders(text)
    if len(made) > 1:
        raise ParameterError(
            f"law {text} is not allowed with --robust, which does not tune: give one value of each parameter, or "
            f"several laws"
        )
    return made[0]


def _robust(laws: list[Contender], noise: list[float], draws: int, folder: Path) -> int:
    """Print the table of wrong models law by law; write it as CSV, as the tables of the docs, and as a picture."""
    if len(noise) != 1:
        raise ParameterError(
            f"noise = {' '.join(f'{level:g}' for level in noise)} is not allowed with --robust: give one level"
        )
    labels = [law.label for law in laws]
    if twice := [label for label in dict.fromkeys(labels) if labels.count(label) > 1]:
        raise ParameterError(f"law {twice[0]} is not allowed twice")
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
        return end(f"error: {folder} cannot be written: {reason(error)}", 1)
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
