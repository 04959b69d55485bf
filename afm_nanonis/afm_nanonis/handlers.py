"""Which function does which command of the table."""

from collections.abc import Callable, Sequence
from typing import Any

Handler = Callable[..., Sequence[Any]]
HANDLERS: dict[str, Handler] = {}
"""By name of the command: called with the front and the arguments, returns the values of the response."""


def handles(*names: str) -> Callable[[Handler], Handler]:
    """Make a function that of these commands."""

    def register(function: Handler) -> Handler:
        HANDLERS.update(dict.fromkeys(names, function))
        return function

    return register
