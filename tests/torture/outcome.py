"""What became of one try, and the file in which the tries of a run are kept."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path


@dataclass
class Outcome:
    """What became of one try."""

    fault: str
    """Name of the fault, as in the table."""
    number: int
    """Of the try, from 0."""
    lost: float = 0.0
    """Wall time whose ticks had been published before the fault and are missing in the recording [s]."""
    what: str = ""
    """What became of it, in a few words: the same words for what is the same."""
    told: dict[str, float] = field(default_factory=dict)
    """Who said it: wall time from the fault to the word [s]."""
    left: list[str] = field(default_factory=list)
    """Processes and shared memory that were left behind."""
    problem: str = ""
    """Why the try failed; empty if it did not."""
    seconds: float = 0.0
    """Wall time that the try took [s]."""


class Book:
    """Outcomes, written down one by one, so that a run that is stopped can be shown and gone on with.

    Parameters
    ----------
    path : Path
    fresh : bool
        Forget what stands there.
    """

    def __init__(self, path: Path, *, fresh: bool) -> None:
        self._path = path
        if fresh:
            path.unlink(missing_ok=True)
        self.outcomes = [Outcome(**json.loads(line)) for line in path.read_text().splitlines()] if path.exists() else []

    def add(self, outcome: Outcome) -> None:
        """Write one down."""
        self.outcomes.append(outcome)
        with self._path.open("a") as file:
            file.write(json.dumps(asdict(outcome)) + "\n")

    def of(self, fault: str) -> list[Outcome]:
        """Those of one fault, the begin and the end of them left out."""
        return [outcome for outcome in self.outcomes if outcome.fault == fault and outcome.number >= 0]
