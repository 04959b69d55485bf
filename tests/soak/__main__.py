"""`make soak`: a session, then a microscope with verbs, other samples and resets, for half an hour in all.

What each of their processes uses has to stay what it was."""

import environment

environment.prepare()

import argparse  # noqa: E402
import shutil  # noqa: E402
import sys  # noqa: E402
from datetime import date  # noqa: E402
from functools import partial  # noqa: E402
from pathlib import Path  # noqa: E402

from page import write_between_marks  # noqa: E402

from afm_recorder_node.reader import read_recording  # noqa: E402
from soak.report import grown, markdown, show, uses  # noqa: E402
from soak.run import endless, soak  # noqa: E402
from soak.verbs import soak_verbs  # noqa: E402

_WARM_ROUNDS = 120
"""Rounds until each kind of work has been beside each other one: memory rises to a level before, and stays there."""
_LEAST = 1.0
"""Minutes below which nothing is judged: that it runs is all that a shorter run shows."""


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="make soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0, help="wall time that is sampled, half of it for verbs")
    parser.add_argument("--warm-up", type=float, default=60.0, help="wall time before that [s]")
    parser.add_argument("--every", type=float, default=2.0, help="wall time between two samples [s]")
    parser.add_argument("--scenario", default="closed_loop_realtime", help="a shipped scenario; its run gets no end")
    parser.add_argument("--out", type=Path, default=Path("out/soak"), help="folder of the session's results")
    parser.add_argument("--page", type=Path, help="page that gets the table between its marks")
    arguments = parser.parse_args()
    judged = arguments.minutes >= _LEAST
    arguments.out.mkdir(parents=True, exist_ok=True)
    scenario = endless(arguments.scenario, arguments.out / "scenario.yaml")
    say = partial(print, flush=True)
    try:
        samples = soak(
            scenario,
            arguments.out,
            seconds=30.0 * arguments.minutes,
            warm_up=arguments.warm_up,
            every=arguments.every,
            told=say,
        )
    except AssertionError as error:
        # On a machine with more to do a run by the clock diverges: it is to have this one for itself.
        print(f"error: {error}", file=sys.stderr)
        return 1
    recording = read_recording(arguments.out / "recording.mcap", every=1000)
    titles = [
        f"{arguments.minutes / 2:g} minutes of {arguments.scenario}, 1000 x {len(recording.time_ticks)} ticks recorded"
    ]
    shutil.rmtree(arguments.out / "verbs", ignore_errors=True)
    verbs, recordings = soak_verbs(
        arguments.out / "verbs",
        seconds=30.0 * arguments.minutes,
        warm_up=arguments.warm_up,
        rounds=4,
        warm_rounds=_WARM_ROUNDS if judged else 2,
        told=say,
    )
    titles.append(
        f"{arguments.minutes / 2:g} minutes of verbs, other samples, other probes and resets, {recordings} recordings"
    )
    parts = [samples, verbs]
    for title, part in zip(titles, parts, strict=True):
        show(title, part)
    if arguments.page:
        tables = "\n\n".join(f"{title}:\n\n{markdown(part)}" for title, part in zip(titles, parts, strict=True))
        write_between_marks(arguments.page, "soak", f"Last run ({date.today()}). {tables}")
    problems = [problem for part in parts for problem in grown(uses(part))] if judged else []
    if not judged:
        print(f"note: {arguments.minutes:g} minutes are too few to judge what is used: give at least {_LEAST:g}")
    if not recording.complete:
        problems.append("the recording is not complete")
    for problem in problems:
        print(f"error: {problem}", file=sys.stderr)
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
