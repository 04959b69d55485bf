"""The parameter file for the nodes: checked values, in a notation that every YAML reader reads alike."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from afm_model import Scenario


class _Dumper(yaml.SafeDumper):  # type: ignore[misc]  # yaml has no types
    """Text in quotes: without them, rcl takes some of it for a number that Python's reader takes for text."""


_Dumper.add_representer(str, lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"'))


def write_parameters(scenario: Scenario, path: Path, more: Mapping[str, Mapping[str, object]] | None = None) -> None:
    """Write the sections of a scenario for `--params-file`.

    Parameters
    ----------
    scenario : Scenario
    path : Path
        File to write.
    more : mapping, optional
        Parameters that count in place of the scenario's: name of one of our nodes, its parameters.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    sections: dict[str, dict[str, Any]] = {
        key: values for key, values in scenario.sections.items() if key != "scenario" and values
    }
    for node, values in (more or {}).items():
        key = f"/**/{node}"
        sections[key] = sections.get(key, {}) | dict(values)
    content = {key: {"ros__parameters": values} for key, values in sections.items()}
    path.write_text(yaml.dump(content, Dumper=_Dumper, allow_unicode=False) if content else "")
