"""State of the plant `lever`, SI units: what its step, docs/lever.md (14) to (23), changes."""

from ..core.records import record
from .lever_apex import APEX_STATE
from .lever_contact import FRAME

STATE = record(
    "X",  # scanner [m], [m/s]
    "V_X",
    "Y",
    "V_Y",
    "Z",
    "V_Z",
    "q",  # bending modes: deflection of the end of the cantilever in each [m], [m/s]
    "v",
    "phi",  # mode of torsion: twist of the end in it [rad], [rad/s]
    "v_phi",
    "A_x",  # place on the sample that the tip holds on to [m]
    "A_y",
    "U_x",  # place under the tip at the last mid-step [m]
    "U_y",
    "S_x",  # way of that place in the last step if the tip was sliding [m]
    "S_y",
    "delta",  # indentation at the last mid-step, along the normal [m]
    "a",  # contact radius [m]
    "N",  # normal force of the last step [N]
    "F_x",  # force of the sample on the tip [N]
    "F_y",
    "F_z",
    "T_x",  # of it, friction along x and y [N]
    "T_y",
    "F_max",  # friction bound [N]
    "d_1",  # direction of the last sliding, along the two tangents
    "d_2",
    "stuck",  # 1.0 if the tip has not moved on the sample in the last step
    "tip",  # deflection of the tip, upwards [m]
    "tip_rate",  # [m/s]
    "shown",  # deflection that the photodiode shows [m]
    "twist",  # of the end [rad]
    "steps",  # since the start
    *FRAME,
    *APEX_STATE,
    vectors=("q", "v"),
)
