"""Errors raised by the model."""

from typing import Any

from .shown import shown


def reason(error: BaseException) -> str:
    """Return why something with a file went wrong, in words."""
    strerror = getattr(error, "strerror", None)
    return shown(str(strerror or error).splitlines()[0].rstrip(".")) if str(error) else type(error).__name__


class Sentence(Exception):
    """An error whose text is one line without control characters, whatever stands in the request or file it names."""

    def __str__(self) -> str:
        return shown(super().__str__())


class ParameterError(Sentence, ValueError):
    """A parameter has a value for which the model does not hold.

    The message is one sentence that names the parameter, its value and what is allowed.
    """


class PartError(Sentence, RuntimeError):
    """A part does not work; the message names the part, its function and the error."""


class DivergenceError(RuntimeError):
    """The motion has left the range of every scanner; the message contains the time and possible remedies."""


class DriveError(Sentence, ValueError):
    """A drive that no piezo can follow; the message names the axis, the value and what is allowed."""


class LawError(RuntimeError):
    """A law that runs somewhere else does not start or does not answer; the message says why."""


class ResultFileError(Sentence, RuntimeError):
    """A file of results that cannot be written or read; the message names the file and says why."""


class MalformedError(Sentence, RuntimeError):
    """Bytes that are no message, or not one that can be meant; the message says in a clause what is wrong with them."""


class VerbError(Sentence, RuntimeError):
    """Something that the microscope cannot do, or has not brought to its end; the message is one sentence that names
    the value and what is allowed.
    """

    outcome: Any = None
    """Of a verb that was begun, how it has ended (`afm_model.microscope.Outcome`), with all that was measured."""
