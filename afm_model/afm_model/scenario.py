"""Scenario files: ROS parameter YAML, one section per node, with a section `scenario` that tells what it is.

`ros2 run ... --params-file` takes the same file. Every name and value is checked here, before anything runs; no ROS is
needed to read one.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from .errors import ParameterError
from .parameters import ControllerParameters, Group, SimParameters, Value, build


class ScenarioError(ValueError):
    """A scenario that does not exist or is not allowed; the message is one sentence."""


class Header(Group):
    """Section `scenario`."""

    title: str = ""
    description: str = ""


@dataclass(frozen=True)
class Scenario:
    """A checked scenario."""

    name: str
    path: Path
    header: Header = Header()
    sim: SimParameters = SimParameters()
    controller: ControllerParameters = ControllerParameters()


NAMESPACE = "afm"
"""Namespace of the nodes."""

_OWN: dict[str, tuple[str, type[Group]]] = {
    "scenario": ("header", Header),
    "afm_sim_node": ("sim", SimParameters),
    "afm_controller_node": ("controller", ControllerParameters),
}


def load_scenario(
    path: Path, others: Mapping[str, type[Group]] | None = None, process: type[Group] | None = None
) -> Scenario:
    """Read and check a scenario file.

    Parameters
    ----------
    path : Path
    others : mapping, optional
        Sections of further nodes, checked and otherwise left alone: name of the node, its parameters.
    process : type[Group], optional
        Parameters of the process that a node runs in, `process.*`, to check them; what happens in a simulation does not
        depend on them.

    Raises
    ------
    ScenarioError
        If the file cannot be read, is no parameter file, or names an unknown section, parameter or value.
    """
    try:
        content = yaml.safe_load(path.read_text())
    except (yaml.YAMLError, UnicodeDecodeError, OSError) as error:
        raise ScenarioError(f"{path} is no readable YAML file: {' '.join(str(error).split())}") from None
    if not isinstance(content, dict):
        raise ScenarioError(f"{path} is no parameter file: it must hold sections such as /**/afm_sim_node")
    known = {name: group for name, (_, group) in _OWN.items()} | dict(others or {})
    parts: dict[str, Any] = {}
    seen: set[str] = set()
    for key, section in content.items():
        node = str(key).rsplit("/", 1)[-1]
        if node not in known:
            raise ScenarioError(f"{path}: unknown section {key}: it must end in one of {', '.join(known)}")
        if key not in ("scenario", f"/**/{node}", f"/{NAMESPACE}/{node}") or (node == "scenario") != (
            key == "scenario"
        ):
            raise ScenarioError(f"{path}: section {key} is read by no node: it must be {_section(node)}")
        if node in seen:
            raise ScenarioError(f"{path}: two sections are for {node}: {key} is one too many")
        seen.add(node)
        if not isinstance(section, dict) or list(section) != ["ros__parameters"]:
            raise ScenarioError(f"{path}: section {key} must hold ros__parameters and nothing else")
        values = section["ros__parameters"] or {}
        if not isinstance(values, dict):
            raise ScenarioError(f"{path}: ros__parameters of {key} = {values} is not allowed: it must hold names")
        try:
            group = build(known[node], _without_process(node, _flat(values), process))
        except ParameterError as error:
            raise ScenarioError(f"{path}: {error}") from None
        if node in _OWN:
            parts[_OWN[node][0]] = group
    return Scenario(path.stem, path, **parts)


def _without_process(node: str, values: dict[str, Value], process: type[Group] | None) -> dict[str, Value]:
    """What is for the model; the rest is checked."""
    if node not in ("afm_sim_node", "afm_controller_node"):
        return values
    of_process = {name: value for name, value in values.items() if name.startswith("process.")}
    if process is not None:
        build(process, of_process)
    return {name: value for name, value in values.items() if name not in of_process}


def _section(node: str) -> str:
    """Key of a node's section."""
    return node if node == "scenario" else f"/**/{node}"


def _flat(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Value]:
    """Nested YAML as dotted names."""
    flat: dict[str, Value] = {}
    for name, value in tree.items():
        if isinstance(value, Mapping):
            flat.update(_flat(value, f"{prefix}{name}."))
        else:
            flat[f"{prefix}{name}"] = value
    return flat
