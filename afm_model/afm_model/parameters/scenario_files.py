"""The scenarios that come with this package, by name."""

import os
from pathlib import Path

_FOLDER = Path(__file__).parents[1] / "scenarios"


def scenario_names() -> list[str]:
    """Names of the scenarios that come with this package; `load_scenario` takes each in place of a file."""
    return sorted(file.stem for file in _FOLDER.glob("*.yaml"))


def scenario_file(name: str | os.PathLike[str]) -> Path:
    """The file of a scenario.

    Parameters
    ----------
    name : str or path
        One of `scenario_names`, or a file. A file that exists counts before a name.

    Raises
    ------
    FileNotFoundError
        If the scenario does not exist; the message is a sentence that lists the names.
    """
    if Path(name).is_file():
        return Path(name)
    if os.fspath(name) in scenario_names():
        return _FOLDER / f"{os.fspath(name)}.yaml"
    raise FileNotFoundError(f"unknown scenario {name}: it must be one of {', '.join(scenario_names())}, or a file")
