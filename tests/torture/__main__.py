"""`make torture`: every fault to order, many times, and what became of each."""

import environment

environment.prepare()

import argparse  # noqa: E402
import re  # noqa: E402
import shutil  # noqa: E402
import signal  # noqa: E402
import sys  # noqa: E402
import time  # noqa: E402
from datetime import date  # noqa: E402
from pathlib import Path  # noqa: E402
from random import Random  # noqa: E402

import support  # noqa: E402
from page import write_between_marks  # noqa: E402

from torture import clients, clock, crafted, disk, exchanges, fuzz, kills, requests, sessions, stops  # noqa: E402
from torture.family import Family, Unavailable  # noqa: E402
from torture.outcome import Book, Outcome  # noqa: E402
from torture.table import markdown, row  # noqa: E402
from torture.trio import CONTROLLER, LOCKSTEP, REALTIME, RECORDER, SIMULATOR  # noqa: E402

FAMILIES = (
    Family("nonsense on all topics", fuzz.family),
    Family("nonsense to all services", requests.family, 0.4),
    Family("bad maps, long names", exchanges.family, 0.2),
    Family("recordings that no recorder writes", crafted.family),
    Family("client of a verb killed or stopped", clients.family, 0.2),
    Family("recorder killed", kills.recorder),
    Family("controller killed, realtime", kills.controller(REALTIME), 0.5),
    Family("controller killed, lockstep", kills.controller(LOCKSTEP), 0.5),
    Family("simulator killed", kills.simulator),
    Family("session: runner killed", sessions.killed(sessions.RUNNER), 0.06),
    Family("session: recorder killed", sessions.killed(RECORDER), 0.06),
    Family("session: simulator killed", sessions.killed(SIMULATOR), 0.06),
    Family("session: controller killed", sessions.killed(CONTROLLER), 0.06),
    Family("recorder stands still", stops.stop(RECORDER), 0.2),
    Family("simulator stands still", stops.stop(SIMULATOR), 0.2),
    Family("controller stands still, realtime", stops.stop(CONTROLLER), 0.2),
    Family("controller stands still, lockstep", stops.stop(CONTROLLER, LOCKSTEP), 0.1),
    Family("subscriber stands still", stops.subscriber, 0.1),
    Family("disk full", disk.full, 0.2),
    Family("limit on the size of a file", disk.limited, 0.2),
    Family("clock set, realtime", clock.steps(REALTIME), 0.2),
    Family("clock set, lockstep", clock.steps(LOCKSTEP), 0.2),
)
_LOST = 1.0
"""What may be lost [s]."""


class Torture:
    """Runs the tries that are still to be done.

    Parameters
    ----------
    book : Book
    folder : Path
        For what the tries need; what a failed one has left stays there.
    seed : int
    asked : int
        Tries of a family with share 1.
    """

    def __init__(self, book: Book, folder: Path, seed: int, asked: int) -> None:
        self._book, self._folder, self._seed, self._asked = book, folder, seed, asked
        self.untried: dict[str, str] = {}
        """Faults that cannot be had here, and why."""

    def run(self, family: Family) -> None:
        """All tries of a family, or those that were not yet done."""
        numbers = list(range(len(self._book.of(family.fault)), family.tries(self._asked)))
        while numbers:
            begun = len(numbers)
            try:
                self._together(family, numbers)
            except Unavailable as error:
                self.untried[family.fault] = str(error)
                return
            except Exception as error:
                # Of a try it is written down already; else it came while they all began or ended.
                if len(numbers) == begun:
                    self._note(family, Outcome(family.fault, numbers.pop(0), problem=f"at the begin: {error}"))
                elif not self._book.outcomes[-1].problem:
                    self._note(family, Outcome(family.fault, -1, problem=f"at the end: {error}"))
            finally:
                support.end_all_processes()

    def _together(self, family: Family, numbers: list[int]) -> None:
        """Tries that share their nodes, up to the first that fails."""
        word = re.sub(r"[^a-z]+", "_", family.fault)
        namespace = f"{word}_{numbers[0]}"
        folder = self._folder / namespace
        shutil.rmtree(folder, ignore_errors=True)
        with support.Graph(rest=0.02) as graph, family.make(graph, folder, namespace) as one:
            while numbers:
                outcome, begin = Outcome(family.fault, numbers[0]), time.monotonic()
                try:
                    one(Random(f"{self._seed}/{family.fault}/{outcome.number}"), outcome)
                    assert outcome.lost <= _LOST, f"{outcome.lost:.2f} s are lost"
                except Exception as error:  # whatever it is, it is written down
                    outcome.problem = f"{type(error).__name__}: {error}"
                    raise
                finally:
                    outcome.seconds = time.monotonic() - begin
                    if not isinstance(sys.exc_info()[1], KeyboardInterrupt):
                        numbers.pop(0)
                        self._note(family, outcome)
        shutil.rmtree(folder, ignore_errors=True)

    def _note(self, family: Family, outcome: Outcome) -> None:
        self._book.add(outcome)
        tries = f"{outcome.number + 1} of {family.tries(self._asked)}" if outcome.number >= 0 else "end"
        said = f"FAILED: {outcome.problem}" if outcome.problem else f"{outcome.what}, {outcome.lost:.2f} s lost"
        print(f"{family.fault}, {tries}: {said} ({outcome.seconds:.1f} s)", flush=True)


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="make torture", description=__doc__)
    parser.add_argument("--tries", type=int, default=50, help="kills of each node; the other faults in proportion")
    parser.add_argument("--seed", type=int, default=1, help="of the moments at which things happen")
    parser.add_argument("--only", default="", help="faults whose name holds this")
    parser.add_argument("--out", type=Path, default=Path("out/torture"), help="folder")
    parser.add_argument("--resume", action="store_true", help="go on with what was done before")
    parser.add_argument("--page", type=Path, help="page that gets the table between its marks")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    arguments.out.mkdir(parents=True, exist_ok=True)
    book = Book(arguments.out / "tries.jsonl", fresh=not arguments.resume)
    torture = Torture(book, arguments.out, arguments.seed, arguments.tries)
    stopped = False
    try:
        for family in FAMILIES:
            if arguments.only in family.fault:
                torture.run(family)
    except KeyboardInterrupt:
        stopped = True
        support.end_all_processes()
    left = [*support.end_all_processes().values(), *support.shared_memory_left()]
    support.remove_shared_memory_left()
    minutes = sum(each.seconds for each in book.outcomes) / 60.0
    options = f' ARGS="--tries {arguments.tries}"' if arguments.tries != parser.get_default("tries") else ""
    lines = [
        f"Last run ({date.today()}): `make torture{options}`, seed {arguments.seed}, {len(book.outcomes)} tries in "
        f"{minutes:.0f} minutes{', stopped before its end' if stopped else ''}.",
        "",
        markdown([row(family.fault, found) for family in FAMILIES if (found := book.of(family.fault))]),
        "",
        *(f"Not tried: {fault}: {why}." for fault, why in torture.untried.items()),
        f"Left after all of it: {', '.join(left) or 'no process and no shared memory'}.",
    ]
    print("\n".join(lines))
    if arguments.page:
        write_between_marks(arguments.page, "torture", "\n".join(lines))
    failed = [outcome for outcome in book.outcomes if outcome.problem]
    for outcome in failed:
        print(f"error: {outcome.fault}, try {outcome.number}: {outcome.problem}", file=sys.stderr)
    return int(bool(failed or stopped))


if __name__ == "__main__":
    sys.exit(main())
