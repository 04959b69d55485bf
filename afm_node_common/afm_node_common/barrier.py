"""One barrier around what others ask of a node: whatever it leads to, the answer is a sentence and the node goes on."""

import inspect
from collections.abc import Callable, Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node

from afm_model.core.errors import ParameterError, VerbError
from afm_model.core.shown import shown

_MOST_ENTRIES, _MOST_LETTERS = 1000, 10_000
"""In a list of a request; in a text."""
_SENTENCES = (ParameterError, VerbError, ArithmeticError, ValueError)
"""Errors whose text is a sentence."""


def sentence(error: BaseException) -> str:
    """What an error says, for the one who asked: a line of bearable length."""
    text = str(error) if isinstance(error, _SENTENCES) and str(error) else f"{type(error).__name__}: {error}"
    text = shown(" ".join(text.split()))
    return text if len(text) <= 2000 else f"{text[:1000]} ... {text[-990:]}"


def too_large(message: Any, name: str = "the request") -> str:
    """Why a message from outside is not looked at, one sentence; empty if it is."""
    if isinstance(message, str):
        if len(message) > _MOST_LETTERS:
            return f"{name} with {len(message)} letters is not allowed: it must have at most {_MOST_LETTERS}"
    elif hasattr(message, "get_fields_and_field_types"):
        for field in message.get_fields_and_field_types():
            if told := too_large(getattr(message, field), field):
                return told
    elif isinstance(message, Sequence) or hasattr(message, "__len__"):
        if len(message) > _MOST_ENTRIES:
            return f"{name} with {len(message)} entries is not allowed: it must have at most {_MOST_ENTRIES}"
        for each in message:
            if isinstance(each, int | float):
                break
            if told := too_large(each, f"an entry of {name}"):
                return told
    return ""


def guard_services(node: Node) -> None:
    """Put the barrier around every service that `node` has now."""
    for service in node.services:
        service.callback = _guarded(node, service.srv_name, service.callback)


def _guarded(node: Node, name: str, callback: Callable[..., Any]) -> Callable[..., Any]:
    def refuse(request: Any, response: Any, told: str) -> Any:
        node.get_logger().warning(f"{name} was refused: {told}")
        return _refusal(request, response, told)

    async def answer_late(request: Any, response: Any) -> Any:
        if told := too_large(request):
            return refuse(request, response, told)
        try:
            return await callback(request, response)
        except GeneratorExit:  # the node ends
            raise
        except BaseException as error:
            return refuse(request, type(response)(), sentence(error))

    def answer(request: Any, response: Any) -> Any:
        if told := too_large(request):
            return refuse(request, response, told)
        try:
            return callback(request, response)
        # MemoryError, RecursionError; SystemExit of a module that is none of ours: signals do not come as exceptions.
        except BaseException as error:
            return refuse(request, type(response)(), sentence(error))

    return answer_late if inspect.iscoroutinefunction(callback) else answer


def _refusal(request: Any, response: Any, told: str) -> Any:
    """An answer that says no, where its type can."""
    fields = response.get_fields_and_field_types()
    if "message" in fields:
        response.message = told
    elif "results" in fields:
        count = min(len(request.parameters), _MOST_ENTRIES)
        response.results = [SetParametersResult(successful=False, reason=told)] * count
    elif "result" in fields:
        if hasattr(result := response.result, "reason"):
            result.reason = told
        else:  # of simulation_interfaces
            result.result, result.error_message = result.RESULT_OPERATION_FAILED, told
    return response
