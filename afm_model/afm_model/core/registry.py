"""Parts by name: those of this package, those that installed packages offer, and any other as `module:NAME`.

A package offers a part by an entry point of the group `afm_model.FAMILY`, such as

    [project.entry-points."afm_model.law"]
    kalman = "my_package.kalman:KALMAN"
"""

import importlib
import sys
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from .errors import ParameterError

_GROUP = "afm_model."
_OWN: dict[str, dict[str, Any]] = {}


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
    module, _, attribute = where.partition(":")
    if not attribute:
        known = ", ".join(names(family))
        raise ParameterError(
            f"there is no {family} {name}: it must be one of {known}, or module:NAME of a part of your own"
        )
    try:
        found = _load(module, attribute)
    except Exception as error:
        # A module may raise anything on import; the message names it.
        raise ParameterError(f"{family} {name} cannot be loaded: {type(error).__name__}: {error}") from error
    if getattr(found, "family", None) != family:
        kind = getattr(found, "family", None) or type(found).__name__
        raise ParameterError(f"{family} {name} is no {family} but a {kind}")
    return found


def _load(module: str, attribute: str) -> Any:
    # A file in the folder in which one works is found as `python my_file.py` would find it.
    if "" not in sys.path:
        sys.path.insert(0, "")
    return getattr(importlib.import_module(module), attribute)
