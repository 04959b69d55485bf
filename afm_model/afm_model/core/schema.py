"""Parameters are declared once, as pydantic models; everything else is read off these declarations.

ROS parameter descriptors, scenario files, messages about bad values and the table in docs/parameters.md all come from
`specifications` and `build`.
"""

import difflib
import math
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, TypeVar, get_args, get_origin

import numpy as np
import pydantic

if pydantic.VERSION.startswith("1."):  # before names are imported that it lacks
    raise ImportError(
        f"afm_model needs pydantic 2, and this is {pydantic.VERSION} (rosdep on Ubuntu 24.04 installs 1): "
        'python3 -m pip install --user --break-system-packages "pydantic>=2", or build with make, which has a .venv'
    )

import annotated_types
from pydantic import BaseModel, ConfigDict, ValidationError, create_model
from pydantic.fields import FieldInfo

from . import registry
from .errors import ParameterError
from .ranges import LARGEST_INTEGER, RANGES, WIDEST

Value = bool | int | float | str
_MANY = 30
"""Names in a sentence."""
_LONGEST = 200
"""Letters of a value in a sentence."""


@dataclass(frozen=True)
class Unit:
    """Unit of a parameter, in SI; "1" for a pure number."""

    symbol: str


class Group(BaseModel):
    """A named group of parameters. Immutable; unknown names, NaN and infinities are refused.

    A group of a `family` belongs to a part and has a parameter `kind`, which chooses the part; the other parameters of
    the group are then those of that part.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=False)
    family: ClassVar[str] = ""
    entries: ClassVar[type["Group"] | None] = None
    """Type of groups in this group under names of one's own, as many as are given: `fault.NAME.kind`."""
    origin: ClassVar[type["Group"] | None] = None
    """The declared model, for one that `with_parts` has made."""

    def __reduce__(self) -> Any:
        # A model made by `with_parts` cannot be found by its name: it is made again where it is read.
        if self.origin is None:
            return super().__reduce__()
        return build, (self.origin, flatten(self))


G = TypeVar("G", bound=Group)

Positive = Annotated[float, annotated_types.Gt(0.0)]
NonNegative = Annotated[float, annotated_types.Ge(0.0)]
_MOST_DEGREES = 360.0
"""A number beyond this is not an angle in degrees."""


@dataclass(frozen=True)
class Specification:
    """One parameter: its dotted name, type, default, bounds (inclusive unless `open`), choices, unit, description."""

    name: str
    kind: type
    default: Value
    unit: str
    description: str
    lower: float | None
    upper: float | None
    lower_open: bool
    upper_open: bool
    choices: tuple[str, ...]
    family: str = ""
    """Of the parts that this parameter chooses from, or none."""
    least: float = 0.0
    """Smallest size of a number that is not 0."""

    def refusal(self, value: Any, *, hints: bool = True) -> str:
        """Why a number is outside its range, one sentence; empty if it is not, or is no number."""
        if self.kind is not float and self.kind is not int:
            each = value if isinstance(value, tuple | list) else ()
            told = (replace(self, name=f"{self.name}[{i}]", kind=float).refusal(one) for i, one in enumerate(each))
            return next(filter(None, told), "")
        with suppress(ValueError):
            number = float(value) if isinstance(value, str) else value
            if isinstance(number, int | float):
                low, high = self.lower, self.upper
                inside = low is None or number > low or (number == low and not self.lower_open)
                inside &= high is None or number < high or (number == high and not self.upper_open)
                small = 0 < abs(number) < self.least
                if small or not inside:
                    unit = "" if self.unit == "1" else f" {self.unit}"
                    size = f", 0 or at least {self.least:g} in size" if inside else ""
                    hint = self._in_radians(number) if hints and not inside else ""
                    return f"{self.name} = {short(value)}{unit} is not allowed: it must be {self.allowed}{size}{hint}"
        return ""

    def meant(self, value: Any) -> Any:
        """Return the choice that a reader of YAML 1.1 takes for this value, `on` for true; any other value as it is."""
        if not self.choices or value in self.choices or (reading := _reading(value)) is None:
            return value
        same = [each for each in self.choices if _reading(each) == reading]
        return same[0] if len(same) == 1 else value

    def _in_radians(self, number: float) -> str:
        """Return an angle that may have been meant in degrees in radians, a clause; empty if it is no such angle."""
        if self.unit != "rad" or not abs(number) <= _MOST_DEGREES:
            return ""
        radians = float(number) * math.pi / 180.0
        return "" if self.refusal(radians, hints=False) else f"; {number:g} degrees are {radians:.6g} rad"

    @property
    def allowed(self) -> str:
        """What values are allowed, in words."""
        if self.family:
            return f"one of {', '.join(registry.names(self.family))}, or module:NAME of a part of your own"
        if self.choices:
            return "one of " + ", ".join(self.choices)
        if self.kind is bool:
            return "true or false"
        noun = {float: "a finite number", int: "a whole number", str: "text"}.get(self.kind, "numbers")
        bounds = []
        if self.lower is not None:
            bounds.append(f"{'>' if self.lower_open else '>='} {self.lower:g}")
        if self.upper is not None:
            bounds.append(f"{'<' if self.upper_open else '<='} {self.upper:g}")
        return " ".join([noun, " and ".join(bounds)]).strip()


_YAML_WORDS = dict.fromkeys(("y", "yes", "true", "on"), "true") | dict.fromkeys(("n", "no", "false", "off"), "false")
"""Words that a reader of YAML 1.1 takes for a boolean if they are not quoted, in whichever case."""


def _reading(value: Any) -> str | float | None:
    """What YAML 1.1 takes a word for, or has taken it for: `true`, `false`, or a number; None: text."""
    word = str(value).lower()
    if word in _YAML_WORDS:
        return _YAML_WORDS[word]
    try:
        return float(word)
    except ValueError:
        return None


def short(value: Any) -> str:
    """A value for a sentence, cut where it is long."""
    try:
        text = str(value)
    except ValueError:  # an int of more digits than Python writes
        return "a number of thousands of digits"
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _specification(name: str, field: FieldInfo, family: str = "") -> Specification:
    kind: Any = field.annotation
    choices: tuple[str, ...] = ()
    if get_origin(kind) is Literal:
        choices, kind = get_args(kind), str
    lower = upper = None
    lower_open = upper_open = False
    number: Any = int if kind is int else float  # the largest int64 is no float
    unit = "1"
    for item in field.metadata:
        if isinstance(item, Unit):
            unit = item.symbol
        elif isinstance(item, annotated_types.Gt | annotated_types.Ge):
            lower_open = isinstance(item, annotated_types.Gt)
            lower = number(item.gt if isinstance(item, annotated_types.Gt) else item.ge)
        elif isinstance(item, annotated_types.Lt | annotated_types.Le):
            upper_open = isinstance(item, annotated_types.Lt)
            upper = number(item.lt if isinstance(item, annotated_types.Lt) else item.le)
    least = 0.0
    if kind is float or kind == tuple[float, ...]:
        least, most = RANGES.get(unit, WIDEST)
        upper = most if upper is None else upper
        if lower is None or (lower_open and lower == 0.0):
            lower, lower_open = (-upper if lower is None else least), False
    elif kind is int:
        upper = LARGEST_INTEGER if upper is None else upper
        lower = -LARGEST_INTEGER if lower is None else lower
    return Specification(
        name,
        kind,
        field.default,
        unit,
        field.description or "",
        lower,
        upper,
        lower_open,
        upper_open,
        choices,
        family,
        least,
    )


def specifications(model: type[Group], prefix: str = "") -> Iterator[Specification]:
    """Every parameter of `model` and of the groups in it, in order, with dotted names."""
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, Group):
            yield from specifications(field.annotation, f"{prefix}{name}.")
        else:
            yield _specification(prefix + name, field, model.family if name == "kind" else "")


@cache
def specified(model: type[Group]) -> dict[str, Specification]:
    """Every parameter of `model` by name; thousands of sets of one model are made in a sweep."""
    return {spec.name: spec for spec in specifications(model)}


def out_of_range(model: type[Group], values: Mapping[str, Any]) -> str:
    """What of these values by dotted names is outside its range, a sentence; empty if nothing is."""
    known = specified(model)
    return "; ".join(filter(None, (known[name].refusal(value) for name, value in values.items())))


def _groups(names: list[str]) -> list[str]:
    """Names as they are if they are few, else their groups."""
    return names if len(names) <= _MANY else list(dict.fromkeys(re.sub(r"\..*", ".*", name) for name in names))


def unknown_name_message(name: str, known: list[str]) -> str:
    """A sentence for a name that does not exist, with the nearest one that does, or all of its group."""
    group, _, leaf = name.rpartition(".")
    same = {each.rpartition(".")[2]: each for each in known if each.rpartition(".")[0] == group}
    near = [same[each] for each in difflib.get_close_matches(leaf, same, n=1)]
    if not near and not same:
        near = difflib.get_close_matches(name, known, n=1)
    if near:
        return f"unknown parameter {name}: did you mean {near[0]}?"
    there = f"{group} has {', '.join(same)}" if group and same else f"known are {', '.join(_groups(known))}"
    return f"unknown parameter {name}: {there}."


def with_parts(model: type[G], values: Mapping[str, Value]) -> type[G]:
    """`model` with the groups of the parts that `values` choose by their `kind`.

    Raises
    ------
    ParameterError
        If there is no such part, or an entry cannot have its name.
    """
    chosen = {}
    for name, field in model.model_fields.items():
        group: Any = field.annotation
        if not (isinstance(group, type) and issubclass(group, Group) and group.family):
            continue
        kind = values.get(f"{name}.kind", group.model_fields["kind"].default)
        try:
            parameters = registry.find(group.family, str(kind)).parameters
        except ParameterError as error:
            raise ParameterError(f"{name}.kind = {kind} is not allowed: {error}") from None
        if parameters.entries is not None and (names := _entry_names(name, parameters, values)):
            parameters = _with_entries(parameters, names)
        if parameters is not group:
            chosen[name] = parameters
    return _with_groups(model, tuple(chosen.items())) if chosen else model


def chosen_group(model: type[Group], name: str, values: Mapping[str, Value]) -> type[Group]:
    """The group `name` of a model, of the part that `values` choose by its `kind`; raises as `with_parts`."""
    group = with_parts(model, values).model_fields[name].annotation
    assert isinstance(group, type) and issubclass(group, Group), name
    return group


def _entry_names(group: str, parameters: type[Group], values: Mapping[str, Value]) -> tuple[str, ...]:
    """Names that `values` give to entries of a group, sorted: in which order they stand in a file means nothing."""
    paths = (name.split(".") for name in values)
    names = sorted({path[1] for path in paths if len(path) == 3 and path[0] == group} - set(parameters.model_fields))
    for name in names:
        if not re.fullmatch("[a-z][a-z0-9_]*", name) or hasattr(parameters, name):
            raise ParameterError(
                f"{group}.{name} is not allowed: the name must be of small letters, digits and _, begin with a letter, "
                f"and not be one that {group} uses itself"
            )
    return tuple(names)


@cache
def _with_entries(group: type[Group], names: tuple[str, ...]) -> type[Group]:
    entry = group.entries
    assert entry is not None
    fields: dict[str, Any] = {name: (entry, entry()) for name in names}
    return create_model(group.__name__, __base__=group, **fields)


@cache
def _with_groups(model: type[G], groups: tuple[tuple[str, type[Group]], ...]) -> type[G]:
    fields: dict[str, Any] = {name: (group, group()) for name, group in groups}
    made = create_model(model.__name__, __base__=model, **fields)
    made.origin = model.origin or model
    return made


def build(model: type[G], values: Mapping[str, Value]) -> G:
    """Make `model` from a flat mapping of dotted names; names not given keep their default.

    Raises
    ------
    ParameterError
        One sentence that names each unknown name, or each value out of its bounds, and what is allowed.
    """
    model = with_parts(model, values)
    known = specified(model)
    nested: dict[str, Any] = {}
    for name, value in values.items():
        if name not in known:
            raise ParameterError(unknown_name_message(name, list(known)))
        value = known[name].meant(value)
        if isinstance(value, bool) and known[name].kind is not bool:
            raise ParameterError(f"{name} = {value} is not allowed: it must be {known[name].allowed}")
        *groups, leaf = name.split(".")
        place = nested
        for group in groups:
            place = place.setdefault(group, {})
        place[leaf] = value
    if told := out_of_range(model, values):
        raise ParameterError(told)
    try:
        return model.model_validate(nested)
    except ValidationError as error:
        raise ParameterError(_sentence(error, known)) from None
    except ArithmeticError as error:
        # Checks over several parameters compute with them.
        given = ", ".join(f"{name} = {value}" for name, value in values.items())
        raise ParameterError(
            f"not allowed together, too large or too small to compute with ({error}): {given}"
        ) from None


def _sentence(error: ValidationError, known: Mapping[str, Specification]) -> str:
    parts = []
    for item in error.errors():
        name = ".".join(str(part) for part in item["loc"])
        if name in known:
            spec = known[name]
            unit = "" if spec.unit == "1" else f" {spec.unit}"
            parts.append(f"{name} = {short(item['input'])}{unit} is not allowed: it must be {spec.allowed}")
        else:
            # Raised by a validator that looks at several parameters and names them itself.
            parts.append(str(item["msg"]).removeprefix("Value error, "))
    return "; ".join(parts)


def python_value(value: Any) -> Any:
    """A number of numpy as one of Python, which parameters are declared as; anything else as it is."""
    return value.item() if isinstance(value, np.generic) else value


def refuse_together(group: Group, prefix: str, *names: str) -> None:
    """Raise ValueError if more than one of these parameters of a group is given, which is when it is not 0.

    Parameters
    ----------
    group : Group
    prefix : str
        What stands before their names in the sentence, such as "detector."; none if empty.
    *names : str
    """
    fields = type(group).model_fields
    units = {name: next(each.symbol for each in fields[name].metadata if isinstance(each, Unit)) for name in names}
    given = [f"{prefix}{name} = {getattr(group, name):g} {units[name]}" for name in names if getattr(group, name)]
    if len(given) > 1:
        raise ValueError(f"{' and '.join(given)} are not allowed together: give one")


def flatten(values: Group, prefix: str = "") -> dict[str, Value]:
    """The inverse of `build`: dotted name to value."""
    flat: dict[str, Value] = {}
    for name in type(values).model_fields:
        value = getattr(values, name)
        if isinstance(value, Group):
            flat.update(flatten(value, f"{prefix}{name}."))
        else:
            flat[prefix + name] = value
    return flat
