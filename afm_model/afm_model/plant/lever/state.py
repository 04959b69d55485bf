"""State of the plant `lever`."""

from typing import Annotated, Any

from ...cantilever.beam import MODES
from ...compiled.jit import kernel
from ...compiled.records import Array, Block, Record, record_at
from ...compiled.ways import by_lane
from ...parts.header import BlockHeader

_OfModes = Annotated[Array, (MODES,)]


class State(Record):
    X: float  # scanner [m], [m/s]
    V_X: float
    Y: float
    V_Y: float
    Z: float
    V_Z: float
    q: _OfModes  # bending modes: deflection of the end of the cantilever in each [m], [m/s]
    v: _OfModes
    phi: float  # mode of torsion: twist of the end in it [rad], [rad/s]
    v_phi: float
    A_x: Annotated[float, "m"]  # place on the sample that the tip holds on to
    A_y: Annotated[float, "m"]
    U_x: Annotated[float, "m"]  # place under the tip at the last mid-step
    U_y: Annotated[float, "m"]
    S_x: Annotated[float, "m"]  # way of that place in the last step if the tip was sliding
    S_y: Annotated[float, "m"]
    delta: Annotated[float, "m"]  # indentation at the last mid-step, along the normal
    a: Annotated[float, "m"]  # contact radius
    N: Annotated[float, "N"]  # normal force of the last step
    F_x: Annotated[float, "N"]  # force of the sample on the tip
    F_y: Annotated[float, "N"]
    F_z: Annotated[float, "N"]
    T_x: Annotated[float, "N"]  # of it, friction along x and y
    T_y: Annotated[float, "N"]
    F_max: Annotated[float, "N"]  # friction bound
    d_1: float  # direction of the last sliding, along the two tangents
    d_2: float
    stuck: float  # 1.0 if the tip has not moved on the sample in the last step
    tip: Annotated[float, "m"]  # deflection of the tip, upwards, with that of the base
    tip_rate: Annotated[float, "m/s"]
    shown: Annotated[float, "m"]  # deflection that the photodiode shows
    twist: Annotated[float, "rad"]  # of the end
    steps: float  # since the start
    fast: float  # steps still to be made in parts, since the tip moved fast at the sample
    unit_force: Annotated[float, "N"]  # units of the contact at this place, see afm_model.contact.maugis
    unit_radius: Annotated[float, "m"]
    unit_indentation: Annotated[float, "m"]
    hamaker_radius: Annotated[float, "J m"]  # Hamaker constant times effective radius
    row: float  # in the table of the contact
    end: Annotated[float, "m"]  # indentation at which contact begins and ends
    tau: Annotated[float, "Pa"]  # friction per area
    V_Ax: Annotated[float, "m/s"]  # rate of the place that the tip holds on to, on a lattice
    V_Ay: Annotated[float, "m/s"]


class Ledger(Record):
    """What a plant keeps outside its state: what the contact has taken, and what it takes in this step."""

    viscous: Annotated[float, "J"]  # energy taken since the start, by viscosity
    bridged: Annotated[float, "J"]  # by liquid bridges
    rubbed: Annotated[float, "J"]  # by friction
    bridge: float  # 1.0 while a bridge holds tip and sample
    pull: Annotated[float, "N"]  # its force as they touch, at this place
    spread2: Annotated[float, "m^2"]  # its volume over pi R_e
    eta: Annotated[float, "Pa s"]  # viscosity of the contact, here
    per: Annotated[float, "1/s"]  # in this step the indentation grows at the rate per (delta - origin)
    origin: Annotated[float, "m"]
    drag: Annotated[float, "Pa s"]  # and the viscous force is drag times radius and rate, and push
    push: Annotated[float, "N"]
    arm: Annotated[float, "N"]  # viscous force at the end of the last step, where it relaxes
    arm_radius: Annotated[float, "m"]  # contact radius then
    stored: Annotated[float, "J"]  # energy then in what relaxes
    stiffness: Annotated[float, "N/m"]  # slopes of normal force and friction bound over the indentation, at the last
    growth: Annotated[float, "N/m"]  # mid-step
    turn: Annotated[float, "rad"]  # of the excitation in half a step, and what follows from it: docs/lever.md (39)
    swing: float  # its cosine and sine
    dip: float
    hardness: Annotated[float, "1/s^2"]
    second_turn: Annotated[float, "rad"]  # the same of a second tone
    second_swing: float
    second_dip: float
    second_hardness: Annotated[float, "1/s^2"]


@kernel
def _ledger_alone(m: Block) -> Ledger:
    return record_at(m, record_at(m, 0, BlockHeader).plant_ledger, Ledger)


@kernel
def _ledger_in_lane(m: Any) -> Any:
    return m.ledger


ledger_of = by_lane(_ledger_alone, _ledger_in_lane)
"""The record of the instrument's block m in which the contact keeps its account."""


@kernel
def _table_alone(m: Block) -> int:
    return record_at(m, 0, BlockHeader).plant_map


@kernel
def _table_in_lane(m: Any) -> int:
    return int(m.own.plant_map)


table_of = by_lane(_table_alone, _table_in_lane)
"""Where the table of the contact begins in the block m."""
