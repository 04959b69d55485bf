"""The joint bridge: scanner and tip as the joints of a robot, for controllers that know `sensor_msgs/JointState`.

It translates one message into the other and keeps no clock. A run in lockstep has the same bits each time if the
controller sends one command for each state that it receives.
"""

import math

from afm_msgs.msg import Measurement, PiezoDrive
from rclpy.node import Node
from sensor_msgs.msg import JointState

from afm_model.parameters import Group
from afm_node_common import runner, topics

STATES, COMMANDS = "joint_states", "joint_commands"
AXES = ("x", "y", "z")
JOINTS = (*AXES, "tip", *(f"{axis}_error" for axis in AXES))
"""Names of the joints, in the order of the states; those of `AXES` have a drive."""
_LOOK = 0.1
"""Wall time between two checks whether a controller is there [s]."""
_BETWEEN_WARNINGS = 10.0  # [s]


def joint_state(measurement: Measurement) -> JointState:
    """Return the joints of a measurement.

    Returns
    -------
    JointState
        `x`, `y`, `z`: position [m], velocity [m/s] and drive [V] of the scanner. `tip`: deflection [m], its rate [m/s]
        and the voltage of the photodetector [V]. `x_error`, `y_error`, `z_error`: position minus reference [m], its
        rate [m/s], and 0; along z those of the tip, whose height is the deflection as long as cantilever.a is 0.
    """
    m = measurement
    place, rate, goal, goal_rate = m.position, m.velocity, m.reference_position, m.reference_velocity
    state = JointState(header=m.header, name=JOINTS)
    state.position = [
        *(place.x, place.y, place.z, m.deflection),
        *(place.x - goal.x, place.y - goal.y, m.deflection - goal.z),
    ]
    state.velocity = [
        *(rate.x, rate.y, rate.z, m.deflection_rate),
        *(rate.x - goal_rate.x, rate.y - goal_rate.y, m.deflection_rate - goal_rate.z),
    ]
    state.effort = [m.drive.x, m.drive.y, m.drive.z, m.deflection_voltage, 0.0, 0.0, 0.0]
    return state


def efforts(command: JointState) -> dict[str, float]:
    """Return the drive [V] of each axis in a command; NaN where no controller is active.

    `effort` has a value for each joint that is named, or for each of `x`, `y`, `z` that is named: some senders name all
    their joints, and list the efforts of those that can be commanded.

    Raises
    ------
    ValueError
        If names and efforts do not match.
    """
    names, values = list(command.name), command.effort
    driven = [name for name in names if name in AXES]
    if len(values) == len(names):
        return {name: value for name, value in zip(names, values, strict=True) if name in AXES}
    if len(values) == len(driven):
        return dict(zip(driven, values, strict=True))
    raise ValueError(
        f"{COMMANDS} has {len(values)} efforts for the joints {', '.join(names) or '(no name)'}: "
        "send the drive [V] of x, y, z as effort, one value for each of them that is named"
    )


class JointBridge(Node):
    """Publishes each measurement as a state of joints, and answers the newest one with each command."""

    def __init__(self) -> None:
        super().__init__("joint_bridge", namespace=topics.NAMESPACE)
        self._states = self.create_publisher(JointState, STATES, topics.CONTROL_QOS)
        self._commands = self.create_subscription(JointState, COMMANDS, self._on_command, topics.CONTROL_QOS)
        self._newest: Measurement | None = None
        self._before: Measurement | None = None  # last measurement of the run before
        self._drive: dict[str, float] = {}  # of each axis, sent last in this run [V]
        self._looks = self.create_timer(_LOOK, self._look)

    def _look(self) -> None:
        """Connect to the instrument once a controller is there: the simulator waits for somebody who answers."""
        if not (self._states.get_subscription_count() and self.count_publishers(self._commands.topic_name)):
            return
        self._looks.cancel()
        self._answers = self.create_publisher(PiezoDrive, topics.PIEZO_DRIVE, topics.CONTROL_QOS)
        self.create_subscription(Measurement, topics.MEASUREMENT, self._on_measurement, topics.CONTROL_QOS)

    def _on_measurement(self, measurement: Measurement) -> None:
        if self._newest is None or measurement.run_id != self._newest.run_id:
            self._before = self._newest
            drive = measurement.drive
            self._drive = {"x": drive.x, "y": drive.y, "z": drive.z}
        self._newest = measurement
        self._states.publish(joint_state(measurement))

    def _on_command(self, command: JointState) -> None:
        """Answer with the efforts of a command.

        An axis that is not commanded keeps its drive. If none is, no controller is active, and nothing is answered.
        """
        try:
            given = {axis: volts for axis, volts in efforts(command).items() if not math.isnan(volts)}
        except ValueError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=_BETWEEN_WARNINGS)
            return
        answered = self._newest
        if answered is None or not given:
            return
        # A command to the last state of the run before, on its way during a reset, does not begin the new run.
        before = self._before
        if before and command.header.stamp == before.header.stamp != answered.header.stamp:
            answered = before
        else:
            self._drive.update(given)
        answer = PiezoDrive(header=answered.header, run_id=answered.run_id, sequence=answered.sequence)
        answer.voltage.x, answer.voltage.y, answer.voltage.z = (self._drive[axis] for axis in AXES)
        self._answers.publish(answer)


def main() -> int:
    """Entry point of `ros2 run afm_bringup joint_bridge`."""
    return runner.run(JointBridge, Group)
