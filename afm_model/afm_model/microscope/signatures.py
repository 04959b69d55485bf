"""Signatures and help of the words of a microscope, from the fields of verbs: for tab completion and `help`."""

import inspect
from collections.abc import Callable
from typing import Any, TypeVar

from ..core.schema import specifications
from .verb import Verb

C = TypeVar("C", bound=Callable[..., Any])


def takes_fields_of(verb: type[Verb]) -> Callable[[C], C]:
    """A decorator: the signature of a function names the fields of a verb in place of its `**fields`."""

    def decorate(word: C) -> C:
        signature = inspect.signature(word)
        own = [each for each in signature.parameters.values() if each.kind != inspect.Parameter.VAR_KEYWORD]
        fields = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=field.annotation)
            for name, field in verb.model_fields.items()
            if name not in signature.parameters
        ]
        word.__signature__ = signature.replace(parameters=[*own, *fields])  # type: ignore[attr-defined]
        return word

    return decorate


def word_of(verb: type[Verb], do: Callable[..., Any]) -> Callable[..., Any]:
    """A function that does a verb; `do(**fields)` is called."""

    @takes_fields_of(verb)
    def word(**fields: Any) -> Any:
        return do(**fields)

    word.__name__ = word.__qualname__ = verb.name
    units = {spec.name: "" if spec.unit == "1" else f" [{spec.unit}]" for spec in specifications(verb)}
    lines = [f"{name}{units[name]}: {field.description}" for name, field in verb.model_fields.items()]
    word.__doc__ = "\n".join([verb.__doc__ or "", "", "Parameters", "----------", *lines])
    return word
