"""A bar on the terminal for what takes longer than a moment."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

Report = Callable[[int, int], None]
"""Called now and then with the work done and the total work."""


@contextmanager
def bar(what: str) -> Iterator[Report]:
    """A bar with the title `what`, drawn on stderr at every report and gone at the end."""
    # Here: nodes import this, and none draws a bar.
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task(what, total=None)
        yield lambda done, total: shown.update(task, completed=done, total=total, refresh=True)


@contextmanager
def reporting(progress: bool | Report, what: str) -> Iterator[Report]:
    """What to report to: a callable as it is; True: a progress bar; False: none."""
    if callable(progress):
        yield progress
    elif not progress:
        yield lambda done, total: None
    else:
        with bar(what) as report:
            yield report
