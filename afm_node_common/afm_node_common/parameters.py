"""ROS parameters from the model's parameter declarations."""

import math
from collections.abc import Callable
from typing import TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from afm_model.errors import ParameterError
from afm_model.parameters import Group, Specification, Value, build, flatten, resolved, specifications
from afm_model.schema import with_parts

from .parameter_services import check_services

G = TypeVar("G", bound=Group)


def _foreign(name: str) -> bool:
    """Whether rclpy itself declares this parameter."""
    return name in ("use_sim_time", "start_type_description_service") or name.startswith("qos_overrides.")


def descriptor(spec: Specification, *, read_only: bool) -> ParameterDescriptor:
    """Descriptor with description, unit, what is allowed and, where both bounds are closed, the range."""
    unit = "" if spec.unit == "1" else f" [{spec.unit}]"
    result = ParameterDescriptor(
        name=spec.name,
        description=f"{spec.description}{unit}",
        additional_constraints=f"{spec.allowed}",
        read_only=read_only,
    )
    if spec.kind is float and spec.lower is not None and spec.upper is not None:
        low = math.nextafter(spec.lower, math.inf) if spec.lower_open else spec.lower
        high = math.nextafter(spec.upper, -math.inf) if spec.upper_open else spec.upper
        result.floating_point_range = [FloatingPointRange(from_value=low, to_value=high, step=0.0)]
    elif spec.kind is int and spec.lower is not None and spec.upper is not None:
        low_int = int(spec.lower) + (1 if spec.lower_open else 0)
        high_int = int(spec.upper) - (1 if spec.upper_open else 0)
        result.integer_range = [IntegerRange(from_value=low_int, to_value=high_int, step=1)]
    return result


def declare(
    node: Node,
    model: type[G],
    *,
    tunable: tuple[str, ...] = (),
    accepts: Callable[[G], object] | None = None,
    on_change: Callable[[G], None] | None = None,
) -> G:
    """Declare every parameter of `model` on `node`, with the values given at start.

    Parameters
    ----------
    node : Node
    model : type[Group]
    tunable : tuple of str
        Names, or prefixes that end in a dot, of what may change while the node runs; the rest is read-only.
    accepts : callable, optional
        Called with validated parameters, at start and before a change; refuses them by raising ParameterError.
    on_change : callable, optional
        Called with the new, validated parameters after a change.

    Returns
    -------
    Group
        The parameters as a validated instance of `model`.

    Raises
    ------
    ParameterError
        If a name given at start does not exist, or a value is not allowed or not accepted. Nothing is declared then.
    """
    # rclpy offers no public way to see values given for names that nobody declares.
    given = {name: p.value for name, p in node._parameter_overrides.items() if not _foreign(name)}
    current = build(model, resolved(model, given))
    if accepts is not None:
        accepts(current)
    values = flatten(current)
    declared = type(current)  # with the parameters of the parts that were chosen
    for spec in specifications(declared):
        free = any(spec.name == name or (name.endswith(".") and spec.name.startswith(name)) for name in tunable)
        node.declare_parameter(spec.name, values[spec.name], descriptor(spec, read_only=not free), ignore_override=True)

    def changed(values: dict[str, Value]) -> G:
        known = {spec.name for spec in specifications(with_parts(declared, values))}
        for name in values:
            if name.endswith(".kind") and known != set(flatten(current)):
                raise ParameterError(
                    f"{name} = {values[name]} is not allowed while the node runs: it has other parameters than "
                    f"{flatten(current)[name]}; start the node with it"
                )
        return build(declared, {**flatten(current), **values})

    def check(parameters: list[Parameter]) -> SetParametersResult:
        try:
            wanted = changed({p.name: p.value for p in parameters if not _foreign(p.name)})
            if accepts is not None:
                accepts(wanted)
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def apply(parameters: list[Parameter]) -> None:
        nonlocal current
        before, current = current, changed({p.name: p.value for p in parameters if not _foreign(p.name)})
        if on_change is not None and current != before:
            on_change(current)

    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(apply)
    check_services(node, list(specifications(declared)))
    return current
