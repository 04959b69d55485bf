"""What `ros2 param set` and `ros2 param load` may send, put right or refused before rclpy sees it.

rclpy alone refuses `5` or `4e-08` for a number that may have decimals, refuses a value that cannot change even if it is
the one in force, and raises out of the service, which ends the node, if the type of a value does not exist.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType, SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

from afm_model.core.errors import Sentence
from afm_model.parameters import Specification, unknown_name_message

_TYPES = frozenset(range(ParameterType.PARAMETER_BOOL, ParameterType.PARAMETER_STRING_ARRAY + 1))
"""Numbers of the types that hold a value."""

_NUMBERS: dict[Parameter.Type, Callable[[Any], Any]] = {Parameter.Type.DOUBLE: float, Parameter.Type.INTEGER: int}
"""`ros2 param` sends 4e-08 as text: to YAML 1.1 a number with an exponent has a point."""


class _Refused(Sentence, ValueError):
    """A parameter that is not taken; the message is one sentence."""


def check_services(node: Node, specifications: Sequence[Specification]) -> None:
    """Make the two services that set parameters of `node` check their requests.

    Parameters
    ----------
    node : Node
        Its parameters are declared.
    specifications : sequence of Specification
        Those of its parameters that are the model's.
    """
    known = {spec.name: spec for spec in specifications}
    for service in node.services:
        if service.srv_type is SetParameters:
            service.callback = _each(node, known, service.callback)
        elif service.srv_type is SetParametersAtomically:
            service.callback = _all_or_none(node, known, service.callback)


def _each(node: Node, known: Mapping[str, Specification], callback: Callable[..., Any]) -> Callable[..., Any]:
    """The service that sets parameters one by one."""

    def answer(request: SetParameters.Request, response: SetParameters.Response) -> SetParameters.Response:
        for message in request.parameters:
            try:
                news = _news(node, known, [message])
            except _Refused as refusal:
                results = [SetParametersResult(successful=False, reason=str(refusal))]
            else:
                results = callback(SetParameters.Request(parameters=news), SetParameters.Response()).results
                results = list(results) or [SetParametersResult(successful=True)]
            response.results = [*response.results, *results]
        return response

    return answer


def _all_or_none(node: Node, known: Mapping[str, Specification], callback: Callable[..., Any]) -> Callable[..., Any]:
    """The service that sets parameters at once."""

    def answer(
        request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        try:
            news = _news(node, known, request.parameters)
        except _Refused as refusal:
            response.result = SetParametersResult(successful=False, reason=str(refusal))
            return response
        if not news:
            response.result = SetParametersResult(successful=True)
            return response
        return callback(SetParametersAtomically.Request(parameters=news), response)

    return answer


def _news(
    node: Node, known: Mapping[str, Specification], messages: Sequence[ParameterMessage]
) -> list[ParameterMessage]:
    """The parameters to set: numbers in their type, without fixed parameters that already have the value."""
    news = []
    for message in messages:
        parameter = _checked(node, known.get(message.name), message)
        present = node.get_parameter(parameter.name)
        same = (parameter.type_, parameter.value) == (present.type_, present.value)
        if not (same and node.describe_parameter(parameter.name).read_only):
            news.append(parameter.to_parameter_msg())
    return news


def _checked(node: Node, spec: Specification | None, message: ParameterMessage) -> Parameter:
    """The parameter in its type.

    Raises
    ------
    _Refused
        If no parameter has that name, or the value is of another type.
    """
    name, value = message.name, message.value
    if not node.has_parameter(name):
        raise _Refused(unknown_name_message(name, list(node.get_parameters_by_prefix(""))))
    kind = node.get_parameter(name).type_
    allowed = spec.allowed if spec else f"of type {kind.name}"
    if value.type == ParameterType.PARAMETER_NOT_SET:
        raise _Refused(f"{name} cannot be removed: it must be {allowed}")
    if value.type not in _TYPES:
        raise _Refused(f"{name} = a value of the unknown type {value.type} is not allowed: it must be {allowed}")
    given, wrong = parameter_value_to_python(value), value.type != kind.value
    if spec is not None and spec.choices:
        # `ros2 param` reads on, off and numbers in a dump as what they are to YAML 1.1.
        given = spec.meant(given)
        wrong = not isinstance(given, str)
    if wrong and kind in _NUMBERS and value.type in (ParameterType.PARAMETER_INTEGER, ParameterType.PARAMETER_STRING):
        with suppress(ValueError):
            given, wrong = _NUMBERS[kind](given), False
    if wrong:
        raise _Refused(f"{name} = {_short(given)} is not allowed: it must be {allowed}")
    if spec is not None and (told := spec.refusal(given)):
        raise _Refused(told)
    return Parameter(name, kind, given)


def _short(value: Any) -> str:
    """A value in words of bearable length."""
    text = str(list(value) if not isinstance(value, str | bool | int | float) else value)
    return text if len(text) <= 60 else f"{text[:57]}..."
