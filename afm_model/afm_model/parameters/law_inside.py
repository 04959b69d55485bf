"""The law inside the simulator: what its controller's parameters are, made of those of the simulator."""

from collections.abc import Mapping

from ..core.schema import Group, Value, build, flatten, with_parts
from ..law import ExternalLaw
from ..law.timing import TIMING, SampledLaw
from .controller import ControllerParameters
from .instrument import InstrumentParameters
from .microscope import known_of

_SHARED = ("scanner.", "cantilever.", "scales.", "contact.", "sample.")
"""What simulator and controller are told in the same words, without a lever."""
_OF_PIEZO = tuple(f"piezo.{name}" for name in ("sensitivity_x", "sensitivity_y", "sensitivity_z", "limit"))


def is_inside(law: Group) -> bool:
    """Whether the law of a simulator is inside it."""
    return not isinstance(law, ExternalLaw)


def controller_of(sim: InstrumentParameters, law: Group) -> ControllerParameters:
    """The controller whose law is inside this simulator: it believes the microscope to be what it is.

    Parameters
    ----------
    sim : InstrumentParameters
    law : Group
        Its group `law`; not the external one.

    Raises
    ------
    ParameterError
        If the law does not allow them.
    """
    own: dict[str, Value] = {f"law.{name}": value for name, value in flatten(law).items()}
    given = flatten(sim)
    piezo = {name: given[name] for name in _OF_PIEZO}
    if sim.plant.cantilever_numbers is not None:
        known = known_of(sim.plant, piezo, own)
    else:
        known = piezo | {name: value for name, value in given.items() if name.startswith(_SHARED)}
    return build(ControllerParameters, known | own)


def timing_inside(model: type[Group], values: Mapping[str, Value]) -> dict[str, Value]:
    """Period and delay of the plant for a law inside the simulator, as far as `values` leave them out.

    Parameters
    ----------
    model : type[Group]
        Of any node.
    values : mapping
        By dotted names.
    """
    if "law.kind" not in values or not issubclass(model, InstrumentParameters) or "law" not in model.model_fields:
        return {}
    fields = with_parts(model, values).model_fields
    law, plant = fields["law"].annotation, fields["plant"].annotation
    if not (isinstance(law, type) and issubclass(law, SampledLaw)) or plant is None:
        return {}
    return {
        f"law.{name}": values.get(f"plant.{of}", plant.model_fields[of].default)
        for name, of in zip(TIMING, ("control_period", "delay_ticks"), strict=True)
        if f"law.{name}" not in values
    }
