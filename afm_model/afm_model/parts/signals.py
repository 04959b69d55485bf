"""What travels between the parts, as records in SI units. Their order is that of the messages in afm_msgs."""

from typing import Annotated

from ..compiled.jit import kernel
from ..compiled.records import Array, Record, Vector


class Measurement(Record):
    """All that is sampled at one control tick, and the reference there: afm_msgs/Measurement after its sequence."""

    deflection: Annotated[float, "m"]  # cantilever deflection z_c - a, as read from the photodetector
    # The true one if the detector is ideal, else the difference of two readings.
    deflection_rate: Annotated[float, "m/s"]
    lateral_force: Annotated[float, "N"]  # force of the sample on the tip along x, as read from the photodetector
    deflection_voltage: Annotated[float, "V"]  # photodetector signals
    lateral_voltage: Annotated[float, "V"]
    position: Annotated[Vector, "m"]  # scanner x, y, z, as read from its sensors
    velocity: Annotated[Vector, "m/s"]  # the same of the position sensors
    reference_position: Annotated[Vector, "m"]  # reference to track: scanner x, y; tip height z
    reference_velocity: Annotated[Vector, "m/s"]
    reference_acceleration: Annotated[Vector, "m/s^2"]
    drive: Annotated[Vector, "V"]  # drive applied until this instant
    drive_sequence: int  # measurement that it answers; -1: none, it is the drive of the start
    newest_drive_sequence: int  # measurement that the newest drive received answers; those between are on their way


class Drive(Record):
    """Drive of x, y, z [V]."""

    voltage: Vector


BASE, TIP, LATERAL, TORSION = range(4)
"""How a cantilever is excited: its base moves across it; a force acts on its tip, across it; its base moves sideways,
along x; its base rocks about the axis of the cantilever.
"""


class Actuation(Drive):
    """What reaches the plant: a drive, and an excitation of the cantilever,
    amplitude cos(phase + angular_frequency (t - since)), and in addition a second one of the same kind.
    """

    # Of the base; TIP: force over the spring constant; TORSION: way of the tip with a base that rocks, without twist.
    amplitude: Annotated[float, "m"]
    angular_frequency: Annotated[float, "rad/s"]
    phase: Annotated[float, "rad"]
    since: Annotated[float, "s"]
    excited: float  # BASE, TIP, LATERAL or TORSION
    second_amplitude: Annotated[float, "m"]
    second_angular_frequency: Annotated[float, "rad/s"]
    second_phase: Annotated[float, "rad"]
    second_since: Annotated[float, "s"]


LONGEST_HORIZON = 512
"""Further drives that one answer may hold at most."""


class PiezoDrive(Record):
    """What answers a measurement: afm_msgs/PiezoDrive from its sequence on; a law without horizon writes `voltage`."""

    sequence: int  # measurement answered; -1: none
    voltage: Annotated[Vector, "V"]  # drive of x, y, z from the arrival of the answer on
    horizon_period: Annotated[float, "s"]  # time between two drives of the horizon
    horizon_count: int  # further drives; 0: `voltage` is held
    # Drive i is in force from (i + 1) horizon_period after the measurement was taken.
    horizon: Annotated[Array, (LONGEST_HORIZON, 3), "V"]


@kernel
def copy_command(source: PiezoDrive, target: PiezoDrive) -> None:
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


class Setpoint(Record):
    """Reference of a program, and what it asks of a z loop inside the instrument."""

    position: Annotated[Vector, "m"]  # scanner x, y; tip height z
    velocity: Annotated[Vector, "m/s"]
    acceleration: Annotated[Vector, "m/s^2"]
    z_mode: float  # FOLLOW, HOLD or OPEN; FOLLOW by default
    z_offset: Annotated[float, "m"]  # of z under OPEN


class Surface(Record):
    """The sample at one place."""

    height: Annotated[float, "z0"]
    slope_x: Annotated[float, "z0/x0"]
    slope_y: Annotated[float, "z0/x0"]
    curvature: Annotated[float, "z0/x0^2"]  # signed mean curvature, positive on a hill
    curvature_xx: Annotated[float, "z0/x0^2"]  # second derivatives
    curvature_yy: Annotated[float, "z0/x0^2"]
    curvature_xy: Annotated[float, "z0/x0^2"]
    strength: Annotated[float, "1"]  # friction strength over that of contact.tau
    adhesion: float  # work of adhesion over that of the plant [1]; 1 if the sample does not write it; plant lever
    modulus: float  # elastic modulus over that of the plant, as adhesion
    viscosity: float  # viscosity of the contact over that of the plant, as adhesion
    tension: float  # surface tension of a liquid bridge times the cosine of the contact angle, as adhesion
    potential_x: Annotated[float, "N"]  # of a sample with a lattice: slope of its potential
    potential_y: Annotated[float, "N"]
    potential_xx: Annotated[float, "N/m"]  # its second derivatives
    potential_yy: Annotated[float, "N/m"]
    potential_xy: Annotated[float, "N/m"]


class Displacement(Record):
    """What a fault does to the sample."""

    there: int  # 0: the sample is as it should be, and the rest does not count
    friction: Annotated[float, "1"]  # friction strength over that of the sample
    x: Annotated[float, "x0"]  # how far the sample has moved
    y: Annotated[float, "x0"]
    z: Annotated[float, "z0"]


class Delivery(Record):
    """Effect of a fault on a measurement as a message: 1.0 if it gets lost, so that there is no answer."""

    lost: float


class Truth(Record):
    """True values from the state of a plant, without noise."""

    position: Annotated[Vector, "m"]  # scanner x, y, z; z is the height of the sample
    velocity: Annotated[Vector, "m/s"]
    tip_height: Annotated[float, "m"]  # z_c
    tip_rate: Annotated[float, "m/s"]
    friction: Vector  # of the sample on the tip, x and y [N]; z is not used
    friction_bound: Annotated[float, "N"]  # largest friction possible
    normal_force: Annotated[float, "N"]
    contact: float  # 1.0 in contact, 0.0 out of it
    stuck: float  # 1.0 while the contact does not slide at all
    deflection_excess: Annotated[float, "m"]  # deflection that the photodiode shows beyond tip_height
    lateral_excess: Annotated[float, "N"]  # lateral force that it shows beyond friction


class Detection(Record):
    """One sample of the photodetector [V]."""

    deflection_voltage: float
    lateral_voltage: float
    amplitude_voltage: float  # of a lock-in inside the instrument, with the samples before this one; 0 without one
