"""Parts by name: those of this package, those that installed packages offer, and any other as `module:NAME`.

A package offers a part by an entry point of the group `afm_model.FAMILY`, such as

    [project.entry-points."afm_model.law"]
    kalman = "my_package.kalman:KALMAN"

To choose `module:NAME` is to run that module: only the user's own words do that, in a program or on a command line.
What reads a file that may come from others does so within `reading`, and what takes messages from others calls `close`
when it has started: a `module:NAME` then chooses among what has been loaded, and loads nothing.
"""

import argparse
import importlib
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from .errors import ParameterError

_GROUP = "afm_model."
_ELSEWHERE = {("law", "predictive"): "afm_predictive"}
"""Package that offers a part which scenarios of this package choose, and which is installed on its own."""
_OWN: dict[str, dict[str, Any]] = {}
_loaded: dict[str, Any] = {}
"""By `module:NAME`."""
_closed = False
_reading = ContextVar("reading", default=False)


def register(*parts: Any) -> None:
    """Make parts of this package known, in the order in which they are listed."""
    for part in parts:
        _OWN.setdefault(part.family, {})[part.name] = part


def shipped(family: str, name: str) -> bool:
    """Whether a part comes with this package."""
    return name in _OWN.get(family, {})


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


def listed(text: str) -> list[str]:
    """Return the parts in a text such as `kalman:KALMAN, patches:PATCHES`."""
    return [part for part in map(str.strip, text.split(",")) if part]


def add_parts(parser: argparse.ArgumentParser) -> None:
    """Add the option by which the user of a command that reads a file names other parts: `parts`, for `reading`."""
    parser.add_argument(
        "--parts",
        type=listed,
        default=[],
        action="extend",
        metavar="MODULE:NAME,...",
        help="parts of your own that the file may choose; their modules are imported, and no others",
    )


def find(family: str, name: str) -> Any:
    """The part of `family` called `name`.

    Raises
    ------
    ParameterError
        If no part has that name, or the part cannot be imported, or it is not of this family.
    """
    if shipped(family, name):
        return _OWN[family][name]
    offered = _offered().get(family, {})
    where = offered[name].value if name in offered else name
    if package := _ELSEWHERE.get((family, where)):
        raise ParameterError(
            f"{family} {name} is in the package {package}, which is not installed: pip install ./{package} in a clone, "
            f"or with ROS 2 build it with the others (make build); or choose one of {', '.join(names(family))}"
        )
    if ":" not in where[:-1]:
        known = ", ".join(names(family))
        raise ParameterError(
            f"there is no {family} {name}: it must be one of {known}, or module:NAME of a part of your own"
        )
    # What is installed was chosen by who installed it: a file may name it.
    found = _load(where, f"{family} {name}", refuse=name == where)
    if getattr(found, "family", None) != family:
        kind = getattr(found, "family", None) or type(found).__name__
        raise ParameterError(f"{family} {name} is no {family} but a {kind}")
    return found


def load(where: str, title: str = "") -> Any:
    """Return what `module:NAME` names.

    The module is searched as Python does, and then in the folder in which the process works.

    Parameters
    ----------
    where : str
    title : str
        What it is for messages; `where` if empty.

    Raises
    ------
    ParameterError
        If it cannot be imported; or was not before `close`, or before a file named it (`reading`).
    """
    return _load(where, title or where, refuse=True)


def _load(where: str, title: str, *, refuse: bool) -> Any:
    """As `load`; `refuse`: only what has been loaded, where a file names it."""
    if where in _loaded and (_closed or _reading.get()):
        return _loaded[where]
    if _closed:
        raise ParameterError(
            f"{title} was not loaded when the node started, and later nothing is: start it with process.parts:={where}"
        )
    if refuse and _reading.get():
        raise ParameterError(
            f"{title} is named by a file, and a file runs no code: if you trust this part, name it yourself by "
            f'--parts {where} (in Python parts=["{where}"])'
        )
    module, _, attribute = where.partition(":")
    try:
        with _working_folder():
            _loaded[where] = getattr(importlib.import_module(module), attribute)
    except (Exception, SystemExit) as error:
        # A module may raise anything on import; the message names it.
        raise ParameterError(f"{title} cannot be loaded: {type(error).__name__}: {error}") from error
    return _loaded[where]


@contextmanager
def reading(parts: Iterable[str] = ()) -> Iterator[None]:
    """Resolve names that come from a file: parts of this package, of installed ones, and what the user has named.

    Parameters
    ----------
    parts : iterable of str
        Parts that the user has named, `module:NAME` each; they are loaded first.

    Raises
    ------
    ParameterError
        If one of `parts` cannot be loaded.
    """
    for part in parts:
        load(part)
    token = _reading.set(True)
    try:
        yield
    finally:
        _reading.reset(token)


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
    """Find modules in the working folder too meanwhile, after all other folders, so that it hides none of theirs."""
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
