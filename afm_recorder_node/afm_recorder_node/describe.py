"""A recording in words: its scenario, its parts, and what of its parameters differs from the defaults. Needs no ROS.

Nothing is imported for it: parameters of parts that are not of this package or installed are shown as they are.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any

from rich.markup import escape

from afm_model import load_scenario, scenario_names
from afm_model.core import registry
from afm_model.core.errors import ParameterError
from afm_model.core.prefix import text
from afm_model.core.schema import Group, build, flatten, specified, with_parts
from afm_model.core.shown import shown
from afm_model.parameters import ControllerParameters, SimParameters

from .recording import About, Value

NODES: dict[str, tuple[type[Group], str]] = {
    "afm_sim_node": (SimParameters, "sim"),
    "afm_controller_node": (ControllerParameters, "controller"),
}
_NOT_THE_RUN = ("run.start_paused", "run.exit_when_finished", "run.wait_for_recorder", "run.telemetry_rate")
"""How a run was started and watched: no two sessions agree in them."""
_NEAR = 6
"""Parameters that differ from those of a scenario and are named."""


def plain(text: object) -> str:
    """Return text of a recording for the terminal: nothing in it is a command to terminal or table."""
    return escape(shown(text))


def quantity(value: float, unit: str) -> str:
    """A value with four digits and its unit, with a prefix; - for none."""
    return text(value, unit, unknown="-")


def group_of(node: str, values: Mapping[str, Value]) -> dict[str, Value]:
    """The parameters of a node of ours that are those of instrument or law, without those of its process."""
    fields = NODES[node][0].model_fields
    return {name: value for name, value in values.items() if name.partition(".")[0] in fields}


def _foreign(node: str, given: Mapping[str, Value]) -> dict[str, Value]:
    """Return the group and kind of each part that is not of this package and not installed."""
    found: dict[str, Value] = {}
    for name, value in given.items():
        group, _, leaf = name.partition(".")
        if leaf == "kind":
            try:
                with registry.reading():
                    with_parts(NODES[node][0], {name: str(value)})
            except ParameterError:
                found[group] = value
    return found


def not_default(node: str, values: Mapping[str, Value]) -> list[tuple[str, Value, Value, str]]:
    """Return the parameters that differ from the defaults of their parts: name, value, default, unit.

    Those of a part whose defaults are not known here are all in it, with an empty default.
    """
    given = group_of(node, values)
    foreign = _foreign(node, given)
    kinds = {
        name: str(given[name]) for name in given if name.endswith(".kind") and name.partition(".")[0] not in foreign
    }
    with registry.reading():
        known = specified(with_parts(NODES[node][0], kinds))
    told: list[tuple[str, Value, Value, str]] = []
    for name, value in given.items():
        if name.partition(".")[0] in foreign:
            told.append((name, value, "", ""))
        elif name in known and value != known[name].default and name not in _NOT_THE_RUN:
            told.append((name, value, known[name].default, known[name].unit))
    return told


def scenario(about: About) -> str:
    """Return the scenario of this package that has the same parameters, or the nearest one and what differs from it."""
    if not about.parameters.keys() & NODES.keys():
        return "not known"
    given: dict[str, dict[str, Value]] = {}
    try:
        for node, (model, field) in NODES.items():
            if node in about.parameters:
                mine: dict[str, Any] = group_of(node, about.parameters[node])
                if foreign := _foreign(node, mine):
                    parts_there = ", ".join(f"{group} {kind}" for group, kind in foreign.items())
                    return f"not known: {parts_there} is not a part of this package or of an installed one"
                with registry.reading():
                    given[field] = dict(flatten(build(model, mine)))
    except ParameterError as error:
        return f"not known here: {error}"
    told: list[tuple[int, str]] = []
    for name in scenario_names():
        differ: list[str] = []
        for field, values in given.items():
            ours = _of_scenario(name)[field]
            differ += [
                f"{each} = {_short(values.get(each, 'none'))}"
                for each in sorted({*ours, *values} - {*_NOT_THE_RUN})
                if ours.get(each) != values.get(each)
            ]
        what = ", ".join(differ) if len(differ) <= _NEAR else f"{len(differ)} other parameters"
        told.append((len(differ), f"{name} with {what}" if differ else name))
    return min(told)[1]


@cache
def _of_scenario(name: str) -> dict[str, dict[str, Value]]:
    """Parameters of a scenario of this package, by the field of `Scenario`."""
    loaded = load_scenario(name)
    return {field: dict(flatten(getattr(loaded, field))) for _, field in NODES.values()}


def parts(about: About) -> tuple[str, str]:
    """The parts of the instrument, and the law, with those that came later."""
    known = about.parameters.get("afm_sim_node", {})
    named = ", ".join(
        f"{name.removesuffix('.kind')} {value}"
        for name, value in known.items()
        if name.count(".") == 1 and name.endswith(".kind") and name != "law.kind"
    )
    law = about.parameters.get("afm_controller_node", known).get("law.kind", "not known")
    if law == "external":
        law = "of a controller that has no parameters law.*"
    later = [str(change.new) for change in about.parameter_changes if change.name == "law.kind"]
    return named or "not known", " then ".join([str(law), *later])


def _short(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
