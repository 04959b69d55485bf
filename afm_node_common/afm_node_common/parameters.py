"""ROS parameters from the model's parameter declarations."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Generic, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from afm_model.core.errors import ParameterError
from afm_model.core.schema import with_parts
from afm_model.parameters import Group, Specification, Value, build, changed, flatten, resolved, specifications
from afm_model.parameters.simulator_parameters import timing_inside

from .parameter_services import check_services

G = TypeVar("G", bound=Group)


def _foreign(name: str) -> bool:
    """Whether rclpy itself declares this parameter."""
    return name in ("use_sim_time", "start_type_description_service") or name.startswith("qos_overrides.")


def descriptor(spec: Specification, *, read_only: bool) -> ParameterDescriptor:
    """Descriptor with description, unit, allowed values and, where both bounds are closed, the range."""
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


class Declared(Generic[G]):
    """The parameters of `model` on a node, with the values given at start.

    Parameters
    ----------
    node : Node
    model : type[Group]
    tunable : tuple of str
        Names, or prefixes that end in a dot, of what may change while the node runs; the rest is read-only.
    complete : callable, optional
        Called with what was given at start; what it returns are the parameters.
    accepts : callable, optional
        Called with validated parameters, at start and before a change; refuses them by raising ParameterError.
    on_change : callable, optional
        Called with the new, validated parameters after a change.
    exchanged : callable, optional
        Called with the parameters at start: prefixes that end in a dot, of what `exchange` may change, and for each the
        services that do.

    Raises
    ------
    ParameterError
        If a name given at start does not exist, or a value is not allowed or not accepted. Nothing is declared then.
    """

    def __init__(
        self,
        node: Node,
        model: type[G],
        *,
        tunable: tuple[str, ...] = (),
        complete: Callable[[G], G] | None = None,
        accepts: Callable[[G], object] | None = None,
        on_change: Callable[[G], None] | None = None,
        exchanged: Callable[[G], Mapping[str, str]] | None = None,
    ) -> None:
        self._node, self._tunable, self._accepts, self._on_change = node, tunable, accepts, on_change
        # rclpy has no public way to read values given for undeclared names.
        given = {name: p.value for name, p in node._parameter_overrides.items() if not _foreign(name)}
        given = resolved(model, given)
        current = build(model, given | timing_inside(model, given))
        if complete is not None:
            current = complete(current)
        self._exchanged = exchanged(current) if exchanged is not None else {}
        if accepts is not None:
            accepts(current)
        self.current = current
        """As they are now."""
        self._model = type(current)  # with the parameters of the parts that were chosen
        self._declare(specifications(self._model))
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)
        check_services(node, list(specifications(self._model)))

    def enter(self, values: Mapping[str, Value]) -> G:
        """Add entries of a group, or change some: only the node itself may. `on_change` is not called.

        Parameters
        ----------
        values : mapping
            By dotted name.

        Raises
        ------
        ParameterError
            If they are not allowed; nothing changes then.
        """
        before = flatten(self.current)
        self.current = changed(self.current, values)
        now = flatten(self.current)
        self._declare(spec for spec in specifications(type(self.current)) if spec.name not in before)
        self._tell(name for name in before if before[name] != now[name])
        return self.current

    def exchange(self, parameters: G) -> None:
        """Take other parameters of the groups in `exchanged`, whichever they have: only the node itself may."""
        before, self.current = flatten(self.current), parameters
        now = flatten(parameters)
        self._model = type(parameters)
        for name in before.keys() - now.keys():
            self._node.undeclare_parameter(name)
        self._declare(spec for spec in specifications(self._model) if spec.name not in before)
        self._tell(name for name in now.keys() & before.keys() if before[name] != now[name])

    def _tell(self, names: Iterable[str]) -> None:
        """Give the node the parameters of these names as they are now."""
        now = flatten(self.current)
        self._node.set_parameters([Parameter(name, value=now[name]) for name in names])

    def _service_for(self, name: str) -> str:
        """What changes a parameter while the node runs; empty: no service does."""
        return next((service for prefix, service in self._exchanged.items() if name.startswith(prefix)), "")

    def _declare(self, specs: Iterable[Specification]) -> None:
        values = flatten(self.current)
        for spec in specs:
            name = spec.name
            free = any(name == each or (each.endswith(".") and name.startswith(each)) for each in self._tunable)
            # An entry may change, but not by anybody: see `_check`.
            about = descriptor(spec, read_only=not free and not self._is_entry(name) and not self._service_for(name))
            self._node.declare_parameter(name, values[name], about, ignore_override=True)

    def _is_entry(self, name: str) -> bool:
        group, _, rest = name.partition(".")
        return "." in rest and getattr(type(getattr(self.current, group, None)), "entries", None) is not None

    def _changed(self, values: dict[str, Value]) -> G:
        current = flatten(self.current)
        known = {spec.name for spec in specifications(with_parts(self._model, current | values))}
        for name in values:
            if (service := self._service_for(name)) and values[name] != current.get(name):
                raise ParameterError(
                    f"{name} = {values[name]} is not allowed while the node runs: it is changed by {service}"
                )
            if name.endswith(".kind") and known != set(current):
                raise ParameterError(
                    f"{name} = {values[name]} is not allowed while the node runs: it has other parameters than "
                    f"{current[name]}; start the node with it"
                )
            if self._is_entry(name) and values[name] != current.get(name):
                raise ParameterError(
                    f"{name} = {values[name]} is not allowed while the node runs: faults are ordered by the service "
                    "order_fault, so that it is known at which tick"
                )
        return changed(self.current, current | values)

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            wanted = self._changed({p.name: p.value for p in parameters if not _foreign(p.name)})
            if self._accepts is not None:
                self._accepts(wanted)
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        before, self.current = (
            self.current,
            self._changed({p.name: p.value for p in parameters if not _foreign(p.name)}),
        )
        if self._on_change is not None and self.current != before:
            self._on_change(self.current)


def declare(
    node: Node,
    model: type[G],
    *,
    tunable: tuple[str, ...] = (),
    accepts: Callable[[G], object] | None = None,
    on_change: Callable[[G], None] | None = None,
) -> G:
    """Declare every parameter of `model` on `node`; its parameters as they are at start. See `Declared`."""
    return Declared(node, model, tunable=tunable, accepts=accepts, on_change=on_change).current
