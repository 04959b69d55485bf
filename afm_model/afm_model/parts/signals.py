"""What travels between the parts, as records in SI units. Their order is that of the messages in afm_msgs."""

from typing import Any

from ..core.jit import kernel
from ..core.records import record

MEASUREMENT = record(
    "deflection",  # cantilever deflection z_c - a, as read from the photodetector [m]
    "deflection_rate",  # the true one if the detector is ideal, else the difference of two readings [m/s]
    "lateral_force",  # force of the sample on the tip along x, as read from the photodetector [N]
    "deflection_voltage",  # photodetector signals [V]
    "lateral_voltage",
    "position",  # scanner x, y, z, as read from its sensors [m]
    "velocity",  # the same of the position sensors [m/s]
    "reference_position",  # reference to track: scanner x, y; tip height z [m]
    "reference_velocity",  # [m/s]
    "reference_acceleration",  # [m/s^2]
    "drive",  # drive applied until this instant [V]
    "drive_sequence",  # measurement that it answers; -1: none, it is the drive of the start
    "newest_drive_sequence",  # measurement that the newest drive received answers; those between are on their way
    integers=("drive_sequence", "newest_drive_sequence"),
    vectors=(
        "position",
        "velocity",
        "reference_position",
        "reference_velocity",
        "reference_acceleration",
        "drive",
    ),
)
"""Everything sampled at one control tick, and the reference to track there: afm_msgs/Measurement after its sequence."""

DRIVE = record("voltage", vectors=("voltage",))
"""Drive of x, y, z [V]."""

ACTUATION = record(
    "voltage",  # drive of x, y, z [V]
    "amplitude",  # of the motion of the cantilever's base [m]
    "angular_frequency",  # [rad/s]
    "phase",  # [rad]
    "since",  # [s]
    vectors=("voltage",),
)
"""What reaches the plant: a DRIVE, and how a dither piezo moves the base of the cantilever, across it:
amplitude cos(phase + angular_frequency (t - since)).
"""

LONGEST_HORIZON = 512
"""Further drives that one answer may hold at most."""

COMMAND = record(
    "sequence",  # measurement answered; -1: none
    "voltage",  # drive of x, y, z from the arrival of the answer on [V]
    "horizon_period",  # time between two drives of the horizon [s]
    "horizon_count",  # further drives; 0: `voltage` is held
    "horizon",  # drive i is in force from (i + 1) horizon_period after the measurement was taken [V]
    vectors=("voltage",),
    integers=("sequence", "horizon_count"),
    arrays={"horizon": (LONGEST_HORIZON, 3)},
)
"""What answers a measurement: afm_msgs/PiezoDrive from its sequence on. A law without a horizon writes `voltage`."""


@kernel
def copy_command(source: Any, target: Any) -> None:
    """Copy what a command holds, not what its horizon does not use."""
    target.sequence = source.sequence
    target.horizon_period = source.horizon_period
    target.horizon_count = source.horizon_count
    for axis in range(3):
        target.voltage[axis] = source.voltage[axis]
        for i in range(source.horizon_count):
            target.horizon[i, axis] = source.horizon[i, axis]


FOLLOW, HOLD, OPEN, GIVEN = range(4)
"""What a loop inside the instrument does with z: follow its setpoint; hold z; move it by `z_offset` from where it stood
when this began; pass on the drive along z that it is given. The last one the instrument's own limits ask for as well:
it goes before whatever the part does otherwise.
"""

REFERENCE = record(
    "position",  # scanner x, y; tip height z [m]
    "velocity",  # [m/s]
    "acceleration",  # [m/s^2]
    "z_mode",  # FOLLOW, HOLD or OPEN; FOLLOW if nobody writes it
    "z_offset",  # of z under OPEN [m]
    vectors=("position", "velocity", "acceleration"),
)
"""Reference of a program, and what it asks of a z loop inside the instrument."""

SURFACE = record(
    "height",  # [z0]
    "slope_x",  # [z0/x0]
    "slope_y",
    "curvature",  # signed mean curvature, positive on a hill [z0/x0^2]
    "curvature_xx",  # second derivatives [z0/x0^2]
    "curvature_yy",
    "curvature_xy",
    "strength",  # friction strength over that of contact.tau [1]
    "adhesion",  # work of adhesion over that of the plant [1]; 1 if the sample does not write it; plant lever
    "potential_x",  # of a sample with a lattice: slope of its potential [N]
    "potential_y",
    "potential_xx",  # its second derivatives [N/m]
    "potential_yy",
    "potential_xy",
)
"""The sample at one place."""

DISPLACEMENT = record(
    "there",  # 0: the sample is as it should be, and the rest does not count
    "friction",  # friction strength over that of the sample [1]
    "x",  # how far the sample has moved [x0]
    "y",
    "z",  # [z0]
    integers=("there",),
)
"""What a fault does to the sample."""

DELIVERY = record("lost")
"""What a fault does to a measurement as a message: 1.0 if it gets lost, so that nobody answers it."""

TRUTH = record(
    "position",  # scanner x, y, z; z is the height of the sample [m]
    "velocity",  # [m/s]
    "tip_height",  # z_c [m]
    "tip_rate",  # [m/s]
    "friction",  # of the sample on the tip, x and y [N]; z is not used
    "friction_bound",  # largest friction possible [N]
    "normal_force",  # [N]
    "contact",  # 1.0 in contact, 0.0 out of it
    "stuck",  # 1.0 while the contact does not slide at all
    "deflection_excess",  # deflection that the photodiode shows beyond tip_height [m]
    "lateral_excess",  # lateral force that it shows beyond friction [N]
    vectors=("position", "velocity", "friction"),
)
"""What a plant tells of its state, without noise."""

DETECTION = record("deflection_voltage", "lateral_voltage")
"""One sample of the photodetector [V]."""
