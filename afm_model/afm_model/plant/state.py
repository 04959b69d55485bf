"""State of the plants of this package: one layout for both, so that every byte of it can be compared."""

from typing import Annotated

from ..compiled.records import Record


class State(Record):
    X: float  # scanner position and rate, x and y [x0], [x0 w0]
    V_X: float
    Y: float
    V_Y: float
    Z: Annotated[float, "z0"]  # height of the sample
    V_Z: Annotated[float, "z0"]
    Q: Annotated[float, "z0"]  # height of the tip apex, z_c of the paper
    V_Q: Annotated[float, "z0"]
    contact: float  # 1.0 in contact, 0.0 out of it
    N: Annotated[float, "m_c w0^2 z0"]  # normal force of the last step
    # Friction of the sample on the tip in the last step, minus that on the scanner.
    F_x: Annotated[float, "m_p w0^2 x0"]
    F_y: Annotated[float, "m_p w0^2 x0"]
    # Largest friction possible in the last step, the radius of the friction disc.
    F_max: Annotated[float, "m_p w0^2 x0"]
