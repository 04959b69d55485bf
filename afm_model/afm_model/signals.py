"""What travels between the parts, as records in SI units. Their order is that of the messages in afm_msgs."""

from .records import record

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

LONGEST_HORIZON = 128
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

REFERENCE = record("position", "velocity", "acceleration", vectors=("position", "velocity", "acceleration"))
"""Reference of a program: scanner x, y; tip height z. [m], [m/s], [m/s^2]."""

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
)
"""The sample at one place."""

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
