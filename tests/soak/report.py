"""What a soak has shown, as a table for a terminal and for a page."""

from collections.abc import Mapping, Sequence

from rich.console import Console
from rich.table import Table

from soak.judgement import COUNTS, INDEX_RATE, Use, judge
from soak.sampling import Sample

HEADER = ("process", "memory [MB]", "MB a minute", "shared memory [MB]", *COUNTS, "processor", "flat")
ON_A_PAGE = ("process", "memory [MB]", "MB a minute", "processor", "flat")
"""Columns of a page; "flat" judges the others, too."""


def uses(samples: Mapping[str, Sequence[Sample]]) -> dict[str, dict[str, Use]]:
    """What became of each quantity of each process."""
    quantities = ("memory", "shared", *COUNTS)
    return {
        name: {quantity: judge(series, quantity, INDEX_RATE.get(name, 0.0)) for quantity in quantities}
        for name, series in samples.items()
    }


def grown(found: Mapping[str, Mapping[str, Use]]) -> list[str]:
    """Sentences about what is not flat."""
    return [
        f"{quantity} of {name} went from {use.begin:.10g} to {use.end:.10g} in {use.seconds:.0f} s"
        for name, quantities in found.items()
        for quantity, use in quantities.items()
        if not use.flat
    ]


def rows(samples: Mapping[str, Sequence[Sample]]) -> list[tuple[str, ...]]:
    """The table, one row for each process; columns as in HEADER."""
    return [
        (
            name,
            _change(of["memory"], 1e6),
            f"{of['memory'].rate * 60e-6:+.3f}",
            _change(of["shared"], 1e6),
            *(_change(of[quantity]) for quantity in COUNTS),
            f"{_processor(samples[name]):.0%}",
            "yes" if all(use.flat for use in of.values()) else "NO",
        )
        for name, of in uses(samples).items()
    ]


def _change(use: Use, unit: float = 0.0) -> str:
    if unit:
        return f"{use.begin / unit:.1f} to {use.end / unit:.1f}"
    return f"{use.end:g}" if use.begin == use.end else f"{use.begin:g} to {use.end:g}"


def _processor(series: Sequence[Sample]) -> float:
    """Processor time per wall time."""
    return (series[-1].processor - series[0].processor) / (series[-1].at - series[0].at)


def show(title: str, samples: Mapping[str, Sequence[Sample]]) -> None:
    """Print the table."""
    table = Table(*HEADER, title=title, title_justify="left")
    for row in rows(samples):
        table.add_row(*row)
    Console().print(table)


def markdown(samples: Mapping[str, Sequence[Sample]]) -> str:
    """The table for a page, with the columns of ON_A_PAGE."""
    chosen = [[cells[HEADER.index(column)] for column in ON_A_PAGE] for cells in rows(samples)]
    lines = [ON_A_PAGE, ["---"] * len(ON_A_PAGE), *chosen]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
