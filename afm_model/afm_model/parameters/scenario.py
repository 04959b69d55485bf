"""Scenario files: ROS parameter YAML, one section per node, with a section `scenario` that describes it, and one
for all nodes, `/**`, that may say what microscope it is.

Every name and value is checked here, before anything runs; no ROS is needed to read one.
"""

import difflib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from ..core import registry
from ..core.errors import ParameterError, Sentence
from ..core.schema import chosen_group, specified, with_parts
from ..law.sampled import TIMING, SampledLaw, require_plant, timing_disagreements
from . import ControllerParameters, Group, SetupSection, SimParameters, Value, build, changed, resolved
from .microscope_parameters import PREFIX
from .scenario_files import scenario_file
from .simulator_parameters import timing_inside
from .strict_yaml import YamlError, check_types, flat, read_yaml


class ScenarioError(Sentence, ValueError):
    """A scenario that does not exist or is not allowed; the message is one sentence."""


class Header(Group):
    """Section `scenario`."""

    title: str = ""
    description: str = ""
    controller: Literal["", "composed"] = ""
    """`composed`: session and launch run our controller in the simulator's process, unless configured otherwise."""


@dataclass(frozen=True)
class Scenario:
    """A checked scenario."""

    name: str
    path: Path
    header: Header = Header()
    sim: SimParameters = SimParameters()
    controller: ControllerParameters = ControllerParameters()
    sections: dict[str, dict[str, Any]] = field(default_factory=dict)
    """What the file gives, section by section, with dotted names: those of other nodes as well, unchecked."""


ALL = "/**"
"""Section that every node reads: parameters `microscope.*`."""
NAMESPACE = "afm"
"""Namespace of the nodes."""

SECTIONS: dict[str, tuple[str, type[Group]]] = {
    "scenario": ("header", Header),
    "afm_sim_node": ("sim", SimParameters),
    "afm_controller_node": ("controller", ControllerParameters),
}
"""Sections of a scenario file: the field of `Scenario` that each becomes, and its parameters."""


def load_scenario(
    name: str | os.PathLike[str],
    others: Mapping[str, type[Group]] | None = None,
    process: type[Group] | None = None,
    overrides: Path | None = None,
    parts: Sequence[str] = (),
) -> Scenario:
    """Read and check a scenario file.

    A file chooses among the parts of this package and of installed ones; it imports nothing.

    Parameters
    ----------
    name : str or path
        A file, or one of `afm_model.scenario_names()`: those that come with this package.
    others : mapping, optional
        Further nodes of ours, whose sections are checked as well: name of the node, its parameters.
    process : type[Group], optional
        Parameters of the process that a node runs in, `process.*`, to check them; what happens in a simulation does not
        depend on them.
    overrides : Path, optional
        A file of the same form; what it gives counts in place of what the scenario gives.
    parts : sequence of str
        Parts of your own that the file may choose, `module:NAME` each; they are imported.

    Raises
    ------
    ScenarioError
        If a file does not exist, cannot be read, is no parameter file, or names a section, parameter or value that
        does not exist; if it chooses a `module:NAME` that is not in `parts`.
    """
    try:
        with registry.reading(parts):
            return _load(name, dict(others or {}), process, overrides)
    except ParameterError as error:  # of `parts`
        raise ScenarioError(str(error)) from None


def _load(
    name: str | os.PathLike[str], others: dict[str, type[Group]], process: type[Group] | None, overrides: Path | None
) -> Scenario:
    try:
        path = scenario_file(name)
    except FileNotFoundError as error:
        raise ScenarioError(str(error)) from None
    known = {node: group for node, (_, group) in SECTIONS.items()} | others
    sections: dict[str, dict[str, Any]] = {}
    for file in (path, overrides):
        if file is not None:
            for key, values in _read_sections(file, known).items():
                model = known.get(key.rsplit("/", 1)[-1], Group)
                sections[key] = overridden(model, sections.get(key, {}), values)
    made: dict[str, Any] = {}
    common = sections.get(ALL, {})
    if common:
        foreign = [name for name in common if not name.startswith(PREFIX)]
        if foreign:
            raise ScenarioError(
                f"{_told(path, overrides)}: unknown section {ALL} for {', '.join(foreign)}: all nodes read only "
                f"{PREFIX}* there; what is for one node must stand in its own, such as {_section('afm_sim_node')}"
            )
        try:
            build(SetupSection, common)
        except ParameterError as error:
            raise ScenarioError(f"{_told(path, overrides)}: section {ALL}: {error}") from None
        for node in ("afm_sim_node", "afm_controller_node"):
            sections.setdefault(_section(node), {})
    # A law may be made for the period and the delay of the plant: that is read first.
    for key, values in sorted(sections.items(), key=lambda item: item[0] == _section("afm_controller_node")):
        node = key.rsplit("/", 1)[-1]
        if node not in known:
            continue
        try:
            if node == "afm_controller_node":
                values.update(law_timing(values, made.get("sim", SimParameters())))
            given = resolved(known[node], common | _without_process(node, values, process))
            group = build(known[node], given | timing_inside(known[node], given))
        except ParameterError as error:
            raise ScenarioError(f"{_told(path, overrides)}: {error}") from None
        if node in SECTIONS:
            made[SECTIONS[node][0]] = group
    sim = made.get("sim", SimParameters())
    if (inside := sim.controller_inside) is not None:
        if sections.get(_section("afm_controller_node")):
            raise ScenarioError(
                f"{_told(path, overrides)}: law.kind = {sim.law.kind} of afm_sim_node puts the law inside the "
                f"simulator: leave out section {_section('afm_controller_node')}, or law.kind"
            )
        made["controller"] = inside
    try:
        require_plant(made.get("controller", ControllerParameters()), sim.plant)
    except ParameterError as error:
        raise ScenarioError(f"{_told(path, overrides)}: {error}") from None
    return Scenario(path.stem, path, **made, sections=sections)


def _told(path: Path, overrides: Path | None) -> str:
    """The files, for a sentence."""
    return str(path) if overrides is None else f"{path} with {overrides}"


def overridden(model: type[Group], given: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of a node with others in their place.

    Where these choose another part by its `kind`, what was given to the former one stays as far as the new one has it.

    Parameters
    ----------
    model : type[Group]
        Of the node.
    given, values : mapping
        By dotted names; `values` count.
    """
    kept = dict(given)
    for name in values:
        group, _, leaf = name.rpartition(".")
        if leaf != "kind" or group not in model.model_fields:
            continue
        default: Any = model.model_fields[group].annotation
        former = [each for each in kept if each.startswith(f"{group}.")]
        if not former or values[name] == given.get(name, default.model_fields["kind"].default):
            continue
        try:
            there = specified(with_parts(model, {**given, **values}))
        except ParameterError:  # a part that another program knows, or a mistake that `build` names
            there = {}
        for each in former:
            if each not in there:
                del kept[each]
    return kept | dict(values)


def law_timing(values: Mapping[str, Value], sim: SimParameters) -> dict[str, Value]:
    """Period and delay of the plant, for a law that is made for them, as far as `values` leave them out.

    Parameters
    ----------
    values : mapping
        Parameters of the controller, by their dotted names.
    sim : SimParameters

    Returns
    -------
    dict
        `law.period` [s] and `law.delay_ticks`, or less; empty for a law that is made for no rate.

    Raises
    ------
    ParameterError
        If there is no such law.
    """
    if not issubclass(chosen_group(ControllerParameters, "law", values), SampledLaw):
        return {}
    plant: dict[str, Value] = {"period": sim.plant.control_period, "delay_ticks": sim.plant.delay_ticks}
    return {f"law.{name}": plant[name] for name in TIMING if f"law.{name}" not in values}


def changed_instrument(scenario: Scenario, news: Mapping[str, Value]) -> SimParameters:
    """Change the instrument of a scenario by dotted names; a law inside it follows as `following` says.

    Raises
    ------
    ParameterError
        As of `changed`.
    """
    sim, timing = scenario.sim, {}
    if not timing_disagreements(sim.law, sim):
        plant = {f"plant.{name}": getattr(sim.plant, name) for name in ("kind", "control_period", "delay_ticks")}
        timing = timing_inside(SimParameters, {"law.kind": sim.law.kind, **plant, **news})
    return changed(sim, {**timing, **news})


def following(scenario: Scenario, sim: SimParameters, values: Mapping[str, Value] | None = None) -> dict[str, Value]:
    """Period and delay of another instrument, for the law of a scenario that is made for those of the scenario.

    Every change of a scenario's instrument goes by this rule: `Microscope`, `sweep`, `simulate_many`.

    Parameters
    ----------
    scenario : Scenario
    sim : SimParameters
        The other instrument.
    values : mapping, optional
        Parameters of the controller that are changed too; what they give of the two counts.

    Returns
    -------
    dict
        As of `law_timing`; empty if the scenario's law is made for another period or delay on purpose.

    Raises
    ------
    ParameterError
        As of `law_timing`.
    """
    if timing_disagreements(scenario.controller.law, scenario.sim):
        return {}
    return law_timing({"law.kind": scenario.controller.law.kind, **(values or {})}, sim)


def _read_sections(path: Path, known: Mapping[str, object]) -> dict[str, dict[str, Any]]:
    """Sections of a file by the key that they have for any namespace; the values of our own nodes are not checked."""
    try:
        content = read_yaml(path)
    except YamlError as error:
        raise ScenarioError(f"{path} is no readable YAML file: {error}") from None
    if not isinstance(content, dict):
        raise ScenarioError(f"{path} is no parameter file: it must hold sections such as /**/afm_sim_node")
    sections: dict[str, dict[str, Any]] = {}
    for key, section in content.items():
        key = str(key)
        node = key.rsplit("/", 1)[-1]
        if key != ALL:
            _check_key(path, key, node, known)
        if node in known:
            key = _section(node)
        if key in sections:
            raise ScenarioError(f"{path}: two sections are for {node}")
        if not isinstance(section, dict) or list(section) != ["ros__parameters"]:
            raise ScenarioError(f"{path}: section {key} must hold ros__parameters and nothing else")
        values = section["ros__parameters"] or {}
        if not isinstance(values, dict):
            raise ScenarioError(f"{path}: ros__parameters of {key} = {values} is not allowed: it must hold names")
        try:
            sections[key] = flat(values)
            if node in known:
                _check_common(sections[key])
            elif key != ALL:
                check_types(sections[key])
        except ValueError as error:
            raise ScenarioError(f"{path}: section {key}: {error}") from None
    return sections


def _check_key(path: Path, key: str, node: str, known: Mapping[str, object]) -> None:
    """Raise if no node of ours, and none that may be a user's, reads a section of this key."""
    if node in known:
        if key not in ("scenario", f"/**/{node}", f"/{NAMESPACE}/{node}") or (node == "scenario") != (
            key == "scenario"
        ):
            raise ScenarioError(f"{path}: section {key} is read by no node: it must be {_section(node)}")
        return
    # A user's my_controller_node is not far from ours either: only what begins as ours do is taken for a slip.
    ours = node.startswith("afm_") or f"afm_{node}" in known
    near = difflib.get_close_matches(node, known, n=1, cutoff=0.6 if ours else 0.85)
    slip = bool(near) and near[0][0] == node[0]
    if slip or ours or "*" in node or not node:
        hint = f": did you mean {_section(near[0])}?" if near else ""
        raise ScenarioError(
            f"{path}: unknown section {key}: it must end in one of {', '.join(known)}, or in the name of a node of "
            f"your own{hint}"
        )
    if not key.startswith("/"):
        raise ScenarioError(f"{path}: section {key} is read by no node: it must be {_section(node)}")


def _check_common(values: Mapping[str, Any]) -> None:
    """Raise if only some nodes have a parameter of the microscope."""
    for name in values:
        if name.startswith(PREFIX):
            raise ValueError(f"{name} is for all nodes: it must stand in section {ALL}")


def _without_process(node: str, values: dict[str, Any], process: type[Group] | None) -> dict[str, Any]:
    """What is for the model; the rest is checked."""
    if node not in ("afm_sim_node", "afm_controller_node"):
        return values
    of_process = {name: value for name, value in values.items() if name.startswith("process.")}
    if process is not None:
        build(process, of_process)
        for part in registry.listed(of_process.get("process.parts", "")):
            registry.load(part, f"process.parts = {part}")
    return {name: value for name, value in values.items() if name not in of_process}


def _section(node: str) -> str:
    """Key of a node's section."""
    return node if node == "scenario" else f"/**/{node}"
