"""Controllers that are wrong, each in one way, as a script of ROS and without it.

python wrong_controllers.py WAY --ros-args ...
"""

import math
import sys
import time
from dataclasses import dataclass, field

FRAME = "scanner"
WAYS = {
    "right": "",
    "silent": "answered",
    "skips": "answered",
    "twice": "once",
    "swaps": "in order",
    "ahead": "asked",
    "late": "in time",
    "nan": "finite",
    "infinite horizon": "finite",
    "no frame": "frame",
    "too far": "range",
    "too steep": "slew",
    "nonsense": "readable",
    "never pauses": "pause",
    "knows it already": "sent again",
    "counts on": "reset",
    "gives up on a fault": "fault",
    "gives up": "alive",
}
"""Way: the rule of the contract that it breaks; what else breaks with it is not said here."""
LATE = 0.4
"""How late a late answer is [s]; the deadline is half of it."""


@dataclass
class Reply:
    """A drive to publish: x [V], y and z as they are."""

    sequence: int
    x: float = 0.0
    frame: str = FRAME
    after: float = 0.0  # wall time from the measurement on [s]
    horizon: float | None = None
    nonsense: bool = False


@dataclass
class Wrong:
    """What a controller that is wrong in this way sends."""

    way: str
    newest: int = -1
    seen: int = 0
    held: list[Reply] = field(default_factory=list)
    ended: bool = False

    def answers(self, sequence: int, position_x: float) -> list[Reply]:
        """Drives to publish for a measurement."""
        self.seen += 1
        again, older = sequence == self.newest, sequence < self.newest
        self.newest = max(self.newest, sequence)
        right = Reply(sequence)
        # From the 50th on, so that the session begins well.
        bad = self.seen > 50
        match self.way:
            case "silent":
                return []
            case "skips" if bad and sequence % 40 == 0:
                return []
            case "twice" if bad:
                return [right, right]
            case "swaps" if 210 <= sequence < 230:
                # In pairs, while measurements come by the clock.
                self.held = [*self.held, right]
                if len(self.held) < 2:
                    return []
                held, self.held = self.held[::-1], []
                return held
            case "ahead" if bad:
                return [Reply(sequence + 1), right]
            case "late" if self.seen == 60:
                return [Reply(sequence, after=LATE)]
            case "nan" if bad:
                return [Reply(sequence, x=math.nan)]
            case "infinite horizon" if bad:
                return [Reply(sequence, horizon=math.inf)]
            case "no frame":
                return [Reply(sequence, frame="")]
            case "too far" if bad:
                return [Reply(sequence, x=min(self.seen - 50.0, 41.0))]
            case "wild":
                return [Reply(sequence, x=1e5 * math.sin(sequence))]
            case "too steep":
                return [Reply(sequence, x=2.0 * (sequence % 2))]
            case "nonsense" if bad:
                return [Reply(sequence, nonsense=True), right]
            case "never pauses":
                return [right, Reply(sequence, after=0.3)]
            case "knows it already" if again:
                return []
            case "counts on" if older:
                return []
            case "gives up on a fault" if position_x == 0.0 and sequence > 3:
                return []
            case "gives up" if self.seen == 60:
                self.ended = True
                return []
        return [right]


def main() -> int:
    """The controller as a node."""
    import rclpy
    from afm_msgs.msg import Measurement, PiezoDrive
    from geometry_msgs.msg import Vector3
    from rclpy.executors import ExternalShutdownException
    from rclpy.node import Node

    rclpy.init()
    node = Node("wrong", namespace="afm")
    wrong = Wrong(sys.argv[1])
    publisher = node.create_publisher(PiezoDrive, "piezo_drive", 10)

    def on_measurement(m: Measurement) -> None:
        for each in wrong.answers(m.sequence, m.position.x):
            time.sleep(each.after)
            drive = PiezoDrive(header=m.header, sequence=each.sequence)
            drive.header.frame_id = each.frame
            drive.voltage.x, drive.voltage.y, drive.voltage.z = each.x, m.drive.y, m.drive.z
            if each.horizon is not None:
                drive.horizon_period, drive.horizon = 1e-3, [Vector3(x=each.horizon)]
            publisher.publish(b"\0\1\0\0\1\2" if each.nonsense else drive)
        if wrong.ended:
            raise SystemExit(3)

    node.create_subscription(Measurement, "measurement", on_measurement, 10)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    return 0


if __name__ == "__main__":
    sys.exit(main())
