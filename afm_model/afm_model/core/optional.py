"""Packages that only some functions need: imported when one is called."""

from importlib import import_module
from typing import Any


def needed(module: str, what: str) -> Any:
    """A module of a package that may be missing.

    Raises
    ------
    ImportError
        If it is: `what` needs it, and how it is installed.
    """
    package = module.partition(".")[0]
    try:
        return import_module(module)
    except ImportError:
        raise ImportError(f"{what} needs {package}, which is not installed: pip install {package}") from None
