"""Errors raised by the model."""


class ParameterError(ValueError):
    """A parameter has a value for which the model does not hold.

    The message is one sentence that names the parameter, its value and what is allowed.
    """
