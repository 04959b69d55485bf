"""State of the plants of this package: one layout for both, so that every byte of it can be compared."""

from ..core.records import record

STATE = record(
    "X",  # scanner position and rate, x and y [x0], [x0 w0]
    "V_X",
    "Y",
    "V_Y",
    "Z",  # height of the sample [z0]
    "V_Z",
    "Q",  # height of the tip apex, z_c of the paper [z0]
    "V_Q",
    "contact",  # 1.0 in contact, 0.0 out of it
    "N",  # normal force of the last step [m_c w0^2 z0]
    "F_x",  # friction of the sample on the tip in the last step, minus that on the scanner [m_p w0^2 x0]
    "F_y",
    "F_max",  # largest friction possible in the last step, the radius of the friction disc [m_p w0^2 x0]
)
