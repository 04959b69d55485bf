"""Plant `lever`: scanner, cantilever and contact as in a laboratory; docs/lever.md."""

import numpy as np

from ...contact.contact_table import table
from ...parts.part import OTHER, Channel, Numbers, Plant
from .check import check, warnings
from .constants import Constants, fine_constants, lever_constants, rows
from .parameters import LeverGroup
from .start import rest
from .state import Ledger, State
from .step import observe, step

_OFF = ("lattice", "thermal", "strengthening", "viscosity", "bridge")


def _common(p: Constants) -> Numbers | None:
    """In lanes: friction on a smooth sample, without heat or losses in the contact."""
    if any(p[name] != 0.0 for name in _OFF):
        return None
    return dict.fromkeys(_OFF, 0.0) | ({"rows": 1} if p.rows == 1 else {})


LEVER = Plant(
    name="lever",
    parameters=LeverGroup,
    constants=Constants,
    state=State,
    ledger=Ledger,
    values=lever_constants,
    check=check,
    rest=rest,
    step=step,
    observe=observe,
    map=lambda parameters: np.append(table(parameters.plant.contact, rows(parameters)), fine_constants(parameters)),
    contact=OTHER,
    sample_in_si=True,
    takes_lattice=True,
    takes_excitation=True,
    warnings=warnings,
    lanes=True,
    common=_common,
    marks=True,
    channels=(
        Channel("truth/lateral_force", "N", "F_x"),
        Channel("truth/torsion", "rad", "twist"),
        Channel("truth/place_x", "m", "U_x"),
        Channel("truth/place_y", "m", "U_y"),
        Channel("truth/apex_x", "m", "A_x"),
        Channel("truth/apex_y", "m", "A_y"),
        Channel("truth/indentation", "m", "delta"),
        Channel("truth/contact_radius", "m", "a"),
        Channel("truth/lost_by_viscosity", "J", "viscous"),
        Channel("truth/lost_by_bridge", "J", "bridged"),
        Channel("truth/lost_by_friction", "J", "rubbed"),
        Channel("truth/bridge", "1", "bridge"),
    ),
)

__all__ = ["LEVER", "Constants", "Ledger", "LeverGroup", "State"]
