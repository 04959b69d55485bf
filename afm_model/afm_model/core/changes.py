"""Change parameters, with the rule for a group whose part is exchanged."""

from collections.abc import Collection, Mapping
from typing import Any

from .schema import G, Group, Value, build, flatten, specified, with_parts


def changed(parameters: G, news: Mapping[str, Value], afresh: Collection[str] = ()) -> G:
    """Change some of these parameters, by dotted names.

    If another part is chosen for a group, what both parts have by a common base class stays, such as the control
    period, which every plant has; the rest is the default of the new part. The part's own kind given again changes
    nothing.

    Parameters
    ----------
    parameters : Group
    news : mapping
    afresh : collection of str
        Groups of which nothing stays: what `news` does not give of them is its default.

    Raises
    ------
    ParameterError
        As `build`.
    """
    model = parameters.origin or type(parameters)
    values = {name: value for name, value in flatten(parameters).items() if name.partition(".")[0] not in afresh}
    if any(name.endswith(".kind") for name in news):
        wanted = with_parts(model, {**values, **news})
        known = specified(wanted)
        others = {
            group: _common(type(getattr(parameters, group)), wanted.model_fields[group].annotation)
            for group in model.model_fields
            if news.get(f"{group}.kind", values.get(f"{group}.kind")) != values.get(f"{group}.kind")
        }
        values = {name: value for name, value in values.items() if name in known and _stays(name, others)}
    return build(model, {**values, **news})  # type: ignore[return-value]  # as declared, with the groups of its parts


def _common(before: type[Group], after: Any) -> type[Group]:
    """The nearest class that the groups of two parts have in common."""
    return next(each for each in after.__mro__ if issubclass(before, each))


def _stays(name: str, others: Mapping[str, type[Group]]) -> bool:
    """Whether a parameter stays when the groups `others`, by name, become those of other parts; of each its common
    class.
    """
    group, _, rest = name.partition(".")
    common = others.get(group)
    return common is None or common.entries is not None or rest in common.model_fields
