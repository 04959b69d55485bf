"""The one reader of parameters as text, and their writer.

It reads the part of YAML that every reader takes for the same thing. The nodes read their parameters by another YAML
library than that of Python. The two differ in what `1:30`, `0b11` and `010` are, and in which of two equal keys counts;
so what is ambiguous is text here, or refused.
"""

import re
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any, ClassVar

import yaml

from ..core.errors import Sentence, reason

Value = bool | int | float | str | list[bool] | list[int] | list[float] | list[str]
# By libyaml, as the nodes themselves read, and twenty times faster.
_Base = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
SIZE_LIMIT = 65_536
"""Bytes of a file."""
DEPTH_LIMIT = 32
"""Sections within sections."""
_INTEGERS = range(-(2**63), 2**63)
"""What the ROS type holds."""
_SHOWN = 40


class YamlError(Sentence, ValueError):
    """YAML that is refused; the message is one sentence without the file's name."""


class _Loader(_Base):  # type: ignore[misc,valid-type]  # yaml has no types
    """YAML without dates, numbers to the base of 60, merged keys, tags."""

    yaml_implicit_resolvers: ClassVar[dict[Any, Any]] = {}  # not those of the class above

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """A mapping, of which each key counts."""
        mapping: dict[Hashable, Any] = {}
        for key_node, value_node in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, str | bool | int | float | None):
                raise YamlError(f"a list or a section is no name{_place(key_node)}")
            if key in mapping:
                raise YamlError(f"the name {_short(str(key))} is given twice{_place(key_node)}")
            mapping[key] = self.construct_object(value_node, deep=True)
        return mapping


def _integer(loader: _Loader, node: yaml.ScalarNode) -> int:
    text = str(node.value)
    # Python itself refuses to read numbers of thousands of digits.
    value = int(text, 0) if len(text) <= 20 else _INTEGERS.stop
    if value not in _INTEGERS:
        raise YamlError(f"the whole number {_short(text)}{_place(node)} is not allowed: it must fit in 64 bits")
    return value


def _add(tag: str, pattern: str, first: str) -> None:
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{tag}", re.compile(f"^(?:{pattern})$"), list(first))


_add("bool", "yes|Yes|YES|no|No|NO|true|True|TRUE|false|False|FALSE|on|On|ON|off|Off|OFF", "yYnNtTfFoO")
_add("int", r"[-+]?(?:0|[1-9][0-9]*)|0x[0-9a-fA-F]+", "-+0123456789")
_add(
    "float",
    r"[-+]?(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[-+]?[0-9]+[eE][-+]?[0-9]+|[-+]?\.(?:inf|Inf|INF)"
    r"|\.(?:nan|NaN|NAN)",
    "-+.0123456789",
)
_Loader.add_implicit_resolver("tag:yaml.org,2002:null", re.compile("^(?:~|null|Null|NULL|)$"), ["~", "n", "N", ""])
_Loader.add_constructor("tag:yaml.org,2002:int", _integer)


def read_yaml(path: Path) -> object:
    """Return what a file holds, of SIZE_LIMIT bytes at most; see `parse_yaml`."""
    try:
        with path.open("rb") as file:
            content = file.read(SIZE_LIMIT + 1)
    except OSError as error:
        raise YamlError(reason(error)) from None
    return parse_yaml(content)


def parse_yaml(content: bytes, limit: int = SIZE_LIMIT) -> object:
    """Return what YAML holds.

    Parameters
    ----------
    content : bytes
    limit : int
        Length that is allowed.

    Returns
    -------
    object
        None, bool, int, float, str, or lists and dictionaries of them.

    Raises
    ------
    YamlError
        If it is not such YAML.
    """
    if len(content) > limit:
        raise YamlError(f"it is too long: it may hold {limit} bytes")
    try:
        text = content.decode()
        _check_structure(text)
        return yaml.load(text, _Loader)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise YamlError(_short(" ".join(str(error).split()), 300)) from None


class _Dumper(yaml.SafeDumper):  # type: ignore[misc]  # yaml has no types
    """Text in quotes: without them, rcl takes some of it for a number that Python's reader takes for text."""

    def ignore_aliases(self, data: object) -> bool:
        """Write a list that stands in two places twice."""
        return True


_Dumper.add_representer(str, lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"'))


def yaml_text(content: Mapping[str, Any], *, sort: bool = True) -> str:
    """Return YAML that every reader takes for `content`; its names sorted, or in their order."""
    return str(yaml.dump(content, Dumper=_Dumper, allow_unicode=False, sort_keys=sort)) if content else ""


def read_sections(content: object) -> dict[str, dict[str, Value]]:
    """Return the parameters in a parameter file, by the key of their section and by dotted name.

    Parameters
    ----------
    content : object
        Of `read_yaml`.

    Raises
    ------
    YamlError
        If it is no parameter file, or a value is not one that a ROS parameter has.
    """
    if not isinstance(content, Mapping):
        raise YamlError("it must hold sections such as /**/afm_sim_node")
    sections: dict[str, dict[str, Value]] = {}
    for key, section in content.items():
        if not isinstance(section, Mapping) or list(section) != ["ros__parameters"]:
            raise YamlError(f"section {_short(str(key))} must hold ros__parameters and nothing else")
        values = section["ros__parameters"]
        if not isinstance(values, Mapping):
            raise YamlError(f"ros__parameters of {_short(str(key))} = {_short(str(values))} must hold names")
        sections[str(key)] = flat(values)
        check_types(sections[str(key)], empty=True)
    return sections


def flat(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested YAML as dotted names; raises YamlError for a name that is given in both ways."""
    made: dict[str, Any] = {}
    for name, value in tree.items():
        news = flat(value, f"{prefix}{name}.") if isinstance(value, Mapping) else {f"{prefix}{name}": value}
        for twice in made.keys() & news.keys():
            raise YamlError(f"{twice} is given twice")
        made.update(news)
    return made


def check_types(values: Mapping[str, Any], *, empty: bool = False) -> None:
    """Raise YamlError if ROS has no type for a value; an empty list has a type in a node that runs."""
    for name, value in values.items():
        types = {type(part) for part in value} if isinstance(value, list) else {type(value)}
        if empty and not types:
            continue
        if len(types) != 1 or not types <= {bool, int, float, str}:
            raise YamlError(
                f"{name} = {_short(str(value))} is not allowed: it must be a number, text, true or false, or a list of "
                f"one of these"
            )


def _check_structure(text: str) -> None:
    """Look at what the file is made of before anything of it is built: some files are built from a line for ever."""
    depth = documents = 0
    for event in yaml.parse(text, _Base):
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            raise YamlError(f"anchors and aliases (&, *) are not allowed{_place(event)}")
        if getattr(event, "tag", None) not in (None, "!"):
            raise YamlError(f"the tag {_short(event.tag)} is not allowed{_place(event)}")
        documents += isinstance(event, yaml.DocumentStartEvent)
        if documents > 1:
            raise YamlError(f"a second document begins{_place(event)}")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEPTH_LIMIT:
            raise YamlError(f"more than {DEPTH_LIMIT} sections within sections{_place(event)}")


def _place(where: Any) -> str:
    return f" (line {where.start_mark.line + 1})"


def _short(text: str, length: int = _SHOWN) -> str:
    return text if len(text) <= length else f"{text[: length - 3]}..."
