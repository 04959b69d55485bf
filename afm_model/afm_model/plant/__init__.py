"""Plants: the equations of motion of scanner, cantilever and contact, and their one time-stepping scheme."""

from typing import Any

from ..core.call import call
from ..core.jit import kernel
from ..core.records import Block, pointer_at, record_at
from ..core.registry import register
from ..parts.header import HEADER
from . import compliant, paper
from .compliant import COMPLIANT
from .constants import CONSTANTS, observe, plant_constants
from .groups import PlantGroup
from .lever import LEVER
from .paper import PAPER, Z_COMPUTED, Z_HELD, Z_UNIFORM
from .state import STATE
from .steps import stable_step

PARTS = (COMPLIANT, PAPER)
register(*PARTS)
# Called by address, like those of somebody else's: the compiled loop knows the paper's alone.
register(LEVER)


@kernel
def step(v: Any, r: Any, m: Block) -> None:
    """Advance the plant of the block m by one integration step; see `afm_model.parts.Plant`."""
    g = record_at(m, 0, HEADER)
    if g.plant == 0:
        p, s = record_at(m, g.plant_constants, CONSTANTS), record_at(m, g.plant_state, STATE)
        compliant.step(v, r, p, s, m)
    elif g.plant == 1:
        p, s = record_at(m, g.plant_constants, CONSTANTS), record_at(m, g.plant_state, STATE)
        paper.step(v, r, p, s, m)
    else:
        constants, state = pointer_at(m, g.plant_constants), pointer_at(m, g.plant_state)
        call(g.plant_step, (v, r, constants, state, pointer_at(m, 0)))


@kernel
def tell(o: Any, m: Block) -> None:
    """Write the truth of the plant of the block m into the record o."""
    g = record_at(m, 0, HEADER)
    if g.plant >= 0:
        observe(record_at(m, g.plant_constants, CONSTANTS), record_at(m, g.plant_state, STATE), o)
    else:
        call(g.plant_observe, (pointer_at(m, g.plant_constants), pointer_at(m, g.plant_state), o))


__all__ = [
    "COMPLIANT",
    "CONSTANTS",
    "LEVER",
    "PAPER",
    "PARTS",
    "STATE",
    "Z_COMPUTED",
    "Z_HELD",
    "Z_UNIFORM",
    "PlantGroup",
    "plant_constants",
    "stable_step",
    "step",
    "tell",
]
