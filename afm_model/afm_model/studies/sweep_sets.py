"""The parameter sets of a sweep: names and values as they are given, checked and built before anything runs."""

from __future__ import annotations

import difflib
import itertools
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import ParameterError
from ..core.schema import with_parts
from ..law import TimingWarning, disagreements
from ..parameters import ControllerParameters, Group, SimParameters, Value, build, flatten, specifications
from ..parameters.scenario import SECTIONS, Scenario, law_timing
from ..run.simulated import ticks_to_simulate

if TYPE_CHECKING:
    import pandas as pd

_SIM, _LAW = "afm_sim_node", "afm_controller_node"
_NODES: dict[str, type[Group]] = {node: group for node, (part, group) in SECTIONS.items() if part != "header"}
Set = tuple[SimParameters, ControllerParameters]


def sweep_columns(
    scenario: Scenario, parameters: Mapping[str, Sequence[Value]] | pd.DataFrame, grid: bool
) -> dict[str, list[Value]]:
    """Names and their values, one a set."""
    given: dict[str, list[Value]] = {}
    for name in parameters:
        values = parameters[name]
        if isinstance(values, str | bytes) or not hasattr(values, "__len__"):
            raise ParameterError(f"{name} = {values} is not allowed in a sweep: it must be a list of values")
        # Plain Python numbers: those of numpy are not what the parameters are declared as.
        given[name] = [value.item() if isinstance(value, np.generic) else value for value in values]
        for value in given[name]:
            if not isinstance(value, int | float | str):
                raise ParameterError(
                    f"{name} = {value} is not allowed in a sweep: a value is a number, a truth or a word"
                )
    _require_known(scenario, given)
    if not isinstance(parameters, Mapping):
        return given
    if grid:
        combinations = list(itertools.product(*given.values()))
        return {name: [values[i] for values in combinations] for i, name in enumerate(given)}
    if len({len(values) for values in given.values()}) > 1:
        lengths = ", ".join(f"{name}: {len(values)}" for name, values in given.items())
        raise ParameterError(f"with grid=False all parameters must have the same number of values ({lengths})")
    return given


def _require_known(scenario: Scenario, given: Mapping[str, Sequence[Value]]) -> None:
    models: dict[str, type[Group]] = {node: type(group) for node, group in _groups(scenario).items()}
    known = [f"{node}.{each.name}" for node, model in models.items() for each in specifications(model)]
    # Where the kind of a part is swept, the parameters of each of the kinds are known.
    for name, values in given.items():
        node, _, parameter = name.partition(".")
        if name in known and parameter.endswith(".kind"):
            for value in values:
                with suppress(ParameterError):
                    model = with_parts(models[node], {parameter: value})
                    known += [f"{node}.{each.name}" for each in specifications(model)]
    names = list(given)
    for name in names:
        if name in known:
            continue
        # What is forgotten or mistaken most easily is the node.
        tails = {each.split(".", 1)[1]: each for each in known}
        tail = str(name).split(".", 1)[-1]
        ends = [each for each in known if each.endswith(f".{name}") or each.endswith(f".{tail}")]
        near = ends or difflib.get_close_matches(str(name), known, n=1)
        near = near or [tails[each] for each in difflib.get_close_matches(str(name), list(tails), n=1)]
        hint = (
            f"did you mean {near[0]}?" if near else f"it must start with {' or '.join(f'{node}.' for node in _NODES)}"
        )
        raise ParameterError(f"unknown parameter {name}: {hint}")


def _groups(scenario: Scenario) -> dict[str, Group]:
    """What the scenario says for each node."""
    return {node: getattr(scenario, SECTIONS[node][0]) for node in _NODES}


def build_sets(scenario: Scenario, columns: Mapping[str, Sequence[Value]]) -> list[Set | str]:
    """The parameters of every set, or the sentence why it is refused."""
    base = _groups(scenario)
    flat = {node: flatten(group) for node, group in base.items()}
    # The same values again and again in a grid: each is checked once.
    built: dict[tuple[Any, ...], Group | str] = {}

    def group(node: str, changed: Mapping[str, Value], kept: Mapping[str, Value]) -> Group | str:
        key = (node, *((name, type(value), value) for name, value in [*changed.items(), *kept.items()]))
        if key not in built:
            try:
                made = build(_NODES[node], _of_the_parts(_NODES[node], {**flat[node], **kept}, changed))
                if isinstance(made, SimParameters):
                    ticks_to_simulate(made)
                built[key] = made
            except ParameterError as error:
                built[key] = str(error)
        return built[key]

    names = {node: [name for name in columns if name.startswith(f"{node}.")] for node in base}
    total = len(next(iter(columns.values()))) if columns else 1
    sets: list[Set | str] = []
    follows = not disagreements(scenario.controller.law, scenario.sim.plant)
    for i in range(total):
        changed = {node: {name[len(node) + 1 :]: columns[name][i] for name in names[node]} for node in base}
        sim = group(_SIM, changed[_SIM], {})
        timing: dict[str, Value] = {}
        # A law that is made for the plant of the scenario is made for that of each set.
        if follows and isinstance(sim, SimParameters):
            with suppress(ParameterError):
                timing = law_timing({"law.kind": flat[_LAW]["law.kind"], **changed[_LAW]}, sim)
        law = group(_LAW, changed[_LAW], timing)
        refused = [each for each in (sim, law) if isinstance(each, str)]
        sets.append("; ".join(refused) if refused else (sim, law))  # type: ignore[arg-type]
    return sets


def warn_of_timing(sets: Sequence[Set | str]) -> None:
    """Warn of the sets whose law is made for another period or delay than those of the plant."""
    told = [disagreements(each[1].law, each[0].plant) for each in sets if not isinstance(each, str)]
    if others := [sentences[0] for sentences in told if sentences]:
        warnings.warn(f"in {len(others)} of {len(sets)} sets {others[0]}", TimingWarning, stacklevel=3)


def _of_the_parts(model: type[Group], base: Mapping[str, Value], changed: Mapping[str, Value]) -> dict[str, Value]:
    """`base` with what is changed; where another part is chosen, without the parameters that the new one does not have.

    Raises
    ------
    ParameterError
        If there is no such part.
    """
    if not any(name.endswith(".kind") for name in changed):
        return {**base, **changed}
    known = {each.name for each in specifications(with_parts(model, {**base, **changed}))}
    return {name: value for name, value in base.items() if name in known} | dict(changed)
