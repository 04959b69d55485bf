"""The scenarios that come with this package, by name, and the one reader of scenario files.

It reads the part of YAML that every reader takes for the same thing. The nodes read their parameters by another YAML
library than that of Python. The two differ in what `1:30`, `0b11` and `010` are, and in which of two equal keys counts;
so what is ambiguous is text here, or refused.
"""

import os
import re
from collections.abc import Hashable
from pathlib import Path
from typing import Any, ClassVar

import yaml

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
        If there is none; the message is a sentence that lists the names.
    """
    if Path(name).is_file():
        return Path(name)
    if os.fspath(name) in scenario_names():
        return _FOLDER / f"{os.fspath(name)}.yaml"
    raise FileNotFoundError(f"unknown scenario {name}: it must be one of {', '.join(scenario_names())}, or a file")


SIZE_LIMIT = 65_536
"""Bytes of a file."""
DEPTH_LIMIT = 32
"""Sections within sections."""
_INTEGERS = range(-(2**63), 2**63)
"""What the ROS type holds."""
_SHOWN = 40


class YamlError(ValueError):
    """A file that is not taken; the message is one sentence without the file's name."""


class _Loader(yaml.SafeLoader):  # type: ignore[misc]  # yaml has no types
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
    """What a file holds.

    Parameters
    ----------
    path : Path

    Returns
    -------
    object
        None, bool, int, float, str, or lists and dictionaries of them.

    Raises
    ------
    YamlError
        If it cannot be read or is no such file.
    """
    try:
        with path.open("rb") as file:
            content = file.read(SIZE_LIMIT + 1)
        if len(content) > SIZE_LIMIT:
            raise YamlError(f"it is too long: it may hold {SIZE_LIMIT} bytes")
        text = content.decode()
        _check_structure(text)
        return yaml.load(text, _Loader)
    except OSError as error:
        raise YamlError(error.strerror or str(error)) from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise YamlError(_short(" ".join(str(error).split()), 300)) from None


def _check_structure(text: str) -> None:
    """Look at what the file is made of before anything of it is built: some files are built from a line for ever."""
    depth = documents = 0
    for event in yaml.parse(text, yaml.SafeLoader):
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
