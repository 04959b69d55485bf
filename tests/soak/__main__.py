"""`make soak`: a session for half an hour; what each of its processes uses has to stay what it was."""

import environment

environment.prepare()

import argparse  # noqa: E402
import sys  # noqa: E402
from datetime import date  # noqa: E402
from pathlib import Path  # noqa: E402

from page import write_between_marks  # noqa: E402

from afm_recorder_node.reader import read_recording  # noqa: E402
from soak.report import grown, markdown, show, uses  # noqa: E402
from soak.run import endless, soak  # noqa: E402


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="make soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0, help="wall time that is sampled")
    parser.add_argument("--warm-up", type=float, default=60.0, help="wall time before that [s]")
    parser.add_argument("--every", type=float, default=2.0, help="wall time between two samples [s]")
    parser.add_argument("--scenario", default="closed_loop_realtime", help="a shipped scenario; its run gets no end")
    parser.add_argument("--out", type=Path, default=Path("out/soak"), help="folder of the session's results")
    parser.add_argument("--page", type=Path, help="page that gets the table between its marks")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    scenario = endless(arguments.scenario, arguments.out / "scenario.yaml")
    samples = soak(
        scenario,
        arguments.out,
        seconds=60.0 * arguments.minutes,
        warm_up=arguments.warm_up,
        every=arguments.every,
        told=lambda line: print(line, flush=True),
    )
    recording = read_recording(arguments.out / "recording.rrd", every=1000)
    title = f"{arguments.minutes:g} minutes of {arguments.scenario}, 1000 x {len(recording.time_ticks)} ticks recorded"
    show(title, samples)
    if arguments.page:
        text = f"Last run ({date.today()}): {title}.\n\n{markdown(samples)}"
        write_between_marks(arguments.page, "soak", text)
    problems = grown(uses(samples))
    if not recording.complete:
        problems.append("the recording is not complete")
    for problem in problems:
        print(f"error: {problem}", file=sys.stderr)
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
