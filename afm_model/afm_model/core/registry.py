"""Parts by name: those of this package, those that installed packages offer, and any other as `module:NAME`.

A package offers a part by an entry point of the group `afm_model.FAMILY`, such as

    [project.entry-points."afm_model.law"]
    kalman = "my_package.kalman:KALMAN"

To choose `module:NAME` is to run that module. A process that takes orders from others calls `close` when it has
started: from then on a name chooses among what has been loaded, and loads nothing.
"""

import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from .errors import ParameterError

_GROUP = "afm_model."
_OWN: dict[str, dict[str, Any]] = {}
_loaded: dict[str, Any] = {}
"""By `module:NAME`."""
_closed = False


def register(*parts: Any) -> None:
    """Make parts of this package known, in the order in which they are listed."""
    for part in parts:
        _OWN.setdefault(part.family, {})[part.name] = part


@cache
def _offered() -> dict[str, dict[str, EntryPoint]]:
    """What installed packages offer, by family: their metadata are read once, not for each family."""
    points = entry_points()
    return {
        group.removeprefix(_GROUP): {point.name: point for point in points.select(group=group)}
        for group in points.groups
        if group.startswith(_GROUP)
    }


def names(family: str) -> list[str]:
    """Names that can be chosen, besides `module:NAME`."""
    own = _OWN.get(family, {})
    return [*own, *(name for name in _offered().get(family, {}) if name not in own)]


def find(family: str, name: str) -> Any:
    """The part of `family` called `name`.

    Raises
    ------
    ParameterError
        If there is none of that name, or it cannot be imported, or it is none of this family.
    """
    if name in _OWN.get(family, {}):
        return _OWN[family][name]
    offered = _offered().get(family, {})
    where = offered[name].value if name in offered else name
    if ":" not in where[:-1]:
        known = ", ".join(names(family))
        raise ParameterError(
            f"there is no {family} {name}: it must be one of {known}, or module:NAME of a part of your own"
        )
    found = load(where, f"{family} {name}")
    if getattr(found, "family", None) != family:
        kind = getattr(found, "family", None) or type(found).__name__
        raise ParameterError(f"{family} {name} is no {family} but a {kind}")
    return found


def load(where: str, title: str = "") -> Any:
    """What `module:NAME` names.

    The module is searched as Python does, and then in the folder in which the process works.

    Parameters
    ----------
    where : str
    title : str
        What it is for messages; `where` if empty.

    Raises
    ------
    ParameterError
        If it cannot be imported; or was not before `close`.
    """
    title = title or where
    if _closed and where not in _loaded:
        raise ParameterError(
            f"{title} was not loaded when the node started, and later nothing is: start it with process.parts:={where}"
        )
    if not _closed:
        module, _, attribute = where.partition(":")
        try:
            with _working_folder():
                _loaded[where] = getattr(importlib.import_module(module), attribute)
        except (Exception, SystemExit) as error:
            # A module may raise anything on import; the message names it.
            raise ParameterError(f"{title} cannot be loaded: {type(error).__name__}: {error}") from error
    return _loaded[where]


def close() -> None:
    """From now on import nothing: whoever sends a message must not have code run that was not named at start.

    What installed packages offer is loaded now.
    """
    global _closed
    for family, offered in _offered().items():
        for name in offered:
            with suppress(ParameterError):
                find(family, name)
    _closed = True


@contextmanager
def _working_folder() -> Iterator[None]:
    """Meanwhile modules are found in the working folder too, behind all others: none of theirs is hidden by it."""
    try:
        folder = os.getcwd()
    except OSError:  # it was removed
        yield
        return
    sys.path.append(folder)
    try:
        yield
    finally:
        # The last: a module may have put in the same.
        if folder in sys.path:
            del sys.path[len(sys.path) - 1 - sys.path[::-1].index(folder)]
