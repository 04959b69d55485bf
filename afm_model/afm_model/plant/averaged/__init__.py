"""Plant `averaged`: a cantilever that taps, amplitude and phase its states; docs/dynamic.md."""

from typing import Any

from ...parts.dispatch import surface
from ...parts.part import OTHER, Channel, Plant, Tree
from ..lever.check import require_blunt_sample
from .force_table import force_table
from .parameters import AveragedGroup, check, warnings
from .state import Constants, Ledger, State, averaged_constants
from .step import observe, step


def rest(parameters: Tree, p: Any, s: Any, m: Any) -> tuple[float, float, float]:
    """The free tip at rest, plant.gap above the sample see `afm_model.parts.Plant`.

    Raises
    ------
    ParameterError
        If the sample is sharper than the tip.
    """
    require_blunt_sample(parameters)
    H = surface(0.0, 0.0, m)
    s.Z = p.a - H.height * p.z0 - parameters.plant.gap
    s.nearest = parameters.plant.gap
    return 0.0, 0.0, float(s.Z / p.metres[2])


AVERAGED = Plant(
    name="averaged",
    parameters=AveragedGroup,
    constants=Constants,
    state=State,
    ledger=Ledger,
    values=averaged_constants,
    check=check,
    rest=rest,
    step=step,
    observe=observe,
    map=force_table,
    contact=OTHER,
    sample_in_si=True,
    takes_excitation=True,
    averages=True,
    time_outside="time_outside",
    warnings=warnings,
    channels=(
        Channel("truth/nearest", "m", "nearest"),
        Channel("truth/amplitude", "m", "amplitude"),
        Channel("truth/outside", "1", "outside"),
        Channel("truth/lost_by_viscosity", "J", "viscous"),
        Channel("truth/lost_by_friction", "J", "rubbed"),
    ),
)

__all__ = ["AVERAGED", "AveragedGroup", "Constants", "Ledger", "State"]
