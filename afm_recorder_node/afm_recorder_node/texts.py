"""Texts in a recording that may come from others: parameters, their changes, the score. Needs no ROS."""

import json
from typing import Any

from afm_model.parameters.strict_yaml import YamlError, check_types, parse_yaml, read_sections

from .recording import RecordingError, Value

LIMIT = 2**20
"""Bytes of a text."""
_VECTORS = ("rms", "max", "max_percent", "drive_total_variation", "extent")
"""Of a score, with x, y and z."""


def parameters_of(text: str) -> dict[str, dict[str, Value]]:
    """Return the parameters by node and name.

    Raises
    ------
    RecordingError
        If the text is not that of a parameter file.
    """
    try:
        return read_sections(parse_yaml(text.encode(errors="surrogatepass"), LIMIT))
    except YamlError as error:
        raise RecordingError(f"its parameters cannot be read: {error}") from None


def score_of(text: str) -> dict[str, Any]:
    """Return the fields of a score: numbers, texts, and vectors and times by name.

    Raises
    ------
    RecordingError
        If the text is not that of a score.
    """
    try:
        score = parse_yaml(text.encode(errors="surrogatepass"), LIMIT)
        if not isinstance(score, dict):
            raise YamlError("it must hold names")
        plain = {str(name): value for name, value in score.items() if not isinstance(value, dict)}
        check_types(plain, empty=True)
        for name, vector in score.items():
            if isinstance(vector, dict):
                numbers = all(type(each) in (int, float) for each in vector.values())
                if not numbers or (name in _VECTORS and vector.keys() != {"x", "y", "z"}):
                    raise YamlError(f"{name} must hold numbers")
    except YamlError as error:
        raise RecordingError(f"its score cannot be read: {error}") from None
    return score


def change_of(text: str) -> dict[str, Any]:
    """Return node, name, old and new value of a parameter that has changed.

    Raises
    ------
    RecordingError
        If the text is not that of a change.
    """
    try:
        if len(text) > LIMIT:
            raise ValueError(f"it is longer than {LIMIT}")
        change = json.loads(text)
        if not isinstance(change, dict) or change.keys() != {"node", "name", "old", "new"}:
            raise ValueError("it must hold node, name, old and new")
        for name in ("node", "name"):
            if not isinstance(change[name], str):
                raise ValueError(f"{name} must be text")
        check_types({name: change[name] for name in ("old", "new") if change[name] is not None}, empty=True)
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"a change of a parameter cannot be read: {error}") from None
    return change
