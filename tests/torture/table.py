"""What a run of the torture has shown: each fault, tries, outcome, lost."""

from collections import Counter
from collections.abc import Sequence

from torture.outcome import Outcome

HEADER = ("fault", "tries", "failed", "lost [s]", "outcome", "reported after at most", "left at most")


def row(fault: str, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    """One line of the table."""
    what = Counter(outcome.what for outcome in outcomes if not outcome.problem)
    told: dict[str, float] = {}
    for outcome in outcomes:
        for name, seconds in outcome.told.items():
            told[name] = max(seconds, told.get(name, 0.0))
    return (
        fault,
        str(len(outcomes)),
        str(sum(bool(outcome.problem) for outcome in outcomes)),
        f"{max(outcome.lost for outcome in outcomes):.2f}",
        "; ".join(f"{text} ({count})" if len(what) > 1 else text for text, count in what.most_common()),
        "; ".join(f"{name}: {seconds:.1f} s" for name, seconds in sorted(told.items())) or "-",
        str(max(len(outcome.left) for outcome in outcomes) or "nothing"),
    )


def markdown(rows: Sequence[Sequence[str]]) -> str:
    """The table for a page."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (HEADER, ["---"] * len(HEADER), *rows))
