"""Controllers that are wrong, each in one way, as a script of ROS and without it.

python wrong_controllers.py WAY --ros-args ...
"""

import math
import random
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
    "names the first run": "run",
    "no frame": "frame",
    "too far": "range",
    "too steep": "slew",
    "nonsense": "readable",
    "never pauses": "pause",
    "knows it already": "sent again",
    "counts on": "reset",
    "gives up on a fault": "fault",
    "gives up": "alive",
    "answers the one before": "present",
    "a microvolt more": "repeats",
    "nan late": "finite",
    "old integral": "repeats",
    "old integral later": "repeats",
    "noise later": "repeats",
    "leaks": "memory",
    "zeros": "response",
    "axes swapped": "response",
    "z upside down": "response",
    "random": "response",
    "x without feedback": "response",
    "feeds back upwards": "response",
    "enormous": "range",
    "stamp 0": "stamp",
    "damps the wrong way": "follows",
    "damps z the wrong way": "follows",
    "gains a thousandth": "follows",
}
"""Way: the rule of the contract that it breaks; what else breaks with it is not said here."""
LATE = 0.4
"""How late a late answer is [s]; the deadline is half of it."""
GAIN = (3e10, 3e10, 5.2e8)
"""[V/m]; those of examples/pd_controller.py, for closed_loop_tanh."""
DAMPING = (6e5, 6e5, 8.4e4)
"""[V s/m]"""


@dataclass
class Reply:
    """A drive to publish."""

    sequence: int
    drive: list[float]  # x, y, z [V]
    frame: str = FRAME
    after: float = 0.0  # wall time from the measurement on [s]
    horizon: float | None = None
    nonsense: bool = False
    stamped: bool = True
    first_run: bool = False


@dataclass
class Wrong:
    """What a controller that is wrong in this way sends."""

    way: str
    newest: int = -1
    seen: int = 0
    held: list[Reply] = field(default_factory=list)
    ended: bool = False
    before: list[float] = field(default_factory=lambda: [0.0] * 3)
    integral: float = 0.0
    leaked: list[bytes] = field(default_factory=list)

    def answers(self, sequence: int, position_x: float, error: list[float], rate: list[float]) -> list[Reply]:
        """Drives to publish for a measurement, with the error of x, y and z, and its rate."""
        self.seen += 1
        again, older = sequence == self.newest, sequence < self.newest
        self.newest = max(self.newest, sequence)
        gains, damping = list(GAIN), list(DAMPING)
        match self.way:
            case "damps the wrong way":
                damping = [-each for each in damping]
            case "damps z the wrong way":
                damping[2] *= -1.0
            case "gains a thousandth":
                gains, damping = [1e-3 * each for each in gains], [1e-3 * each for each in damping]
        drive = [gains[i] * error[i] + damping[i] * rate[i] for i in range(3)]
        before, self.before = self.before, drive
        right = Reply(sequence, drive)

        def x(value: float) -> list[Reply]:
            return [Reply(sequence, [value, *drive[1:]])]

        # From the 50th on, so that the session begins well.
        bad = self.seen > 50
        match self.way:
            case "silent":
                return []
            case "skips" if bad and sequence % 40 == 0:
                return []
            case "twice" if bad:
                return [right, right]
            case "swaps" if 2010 < self.seen <= 2030:
                # In pairs, while measurements come by the clock.
                self.held = [*self.held, right]
                if len(self.held) < 2:
                    return []
                held, self.held = self.held[::-1], []
                return held
            case "ahead" if bad:
                return [Reply(sequence + 1, drive), right]
            case "late" if self.seen == 60:
                return [Reply(sequence, drive, after=LATE)]
            case "nan" if bad:
                return x(math.nan)
            case "infinite horizon" if bad:
                return [Reply(sequence, drive, horizon=math.inf)]
            case "names the first run":
                return [Reply(sequence, drive, first_run=True)]
            case "no frame":
                return [Reply(sequence, drive, frame="")]
            case "too far" if sequence == 60:
                return x(401.0)
            case "wild":
                return x(1e5 * math.sin(sequence))
            case "too steep" if sequence in (60, 61):
                return x(310.0 if sequence % 2 else -310.0)
            case "nonsense" if bad:
                return [Reply(sequence, drive, nonsense=True), right]
            case "never pauses" if 2045 < self.seen <= 2050:
                # The last ones before the pause: every one would take six minutes.
                return [right, Reply(sequence, drive, after=0.3)]
            case "knows it already" if again:
                return []
            case "counts on" if older:
                return []
            case "gives up on a fault" if position_x == 0.0 and sequence > 3:
                return []
            case "gives up" if self.seen == 60:
                self.ended = True
                return []
            case "answers the one before":
                return [Reply(sequence, before)]
            case "a microvolt more":
                return x(drive[0] + 1e-6 * self.seen)
            case "nan late" if self.seen == 3000:
                return x(math.nan)
            case "old integral":
                self.integral += 1e-3 * drive[0]
                return x(drive[0] + self.integral)
            case "old integral later":
                self.integral += 1e-3 * drive[0]
                if sequence >= 200:
                    return x(drive[0] + self.integral)
            case "noise later" if sequence >= 200:
                return x(drive[0] + random.gauss(0.0, 1e-6))
            case "leaks":
                self.leaked.append(b"x" * 100_000)
            case "zeros":
                return [Reply(sequence, [0.0] * 3)]
            case "axes swapped":
                return [Reply(sequence, [drive[1], drive[0], drive[2]])]
            case "z upside down":
                return [Reply(sequence, [*drive[:2], -drive[2]])]
            case "x without feedback":
                return x(drive[0] + GAIN[0] * position_x)
            case "feeds back upwards":
                return x(drive[0] + 2.0 * GAIN[0] * position_x)
            case "random":
                return [Reply(sequence, [random.gauss(0.0, 0.1) for _ in range(3)])]
            case "enormous" if bad:
                return x(1e12)
            case "stamp 0":
                return [Reply(sequence, drive, stamped=False)]
        return [right]


def main() -> int:
    """The controller as a node."""
    import rclpy
    from afm_msgs.msg import Measurement, PiezoDrive
    from geometry_msgs.msg import Vector3
    from rclpy.executors import ExternalShutdownException
    from rclpy.node import Node
    from std_msgs.msg import Header

    rclpy.init()
    node = Node("wrong", namespace="afm")
    wrong = Wrong(sys.argv[1])
    publisher = node.create_publisher(PiezoDrive, "piezo_drive", 10)
    runs: list[int] = []

    def on_measurement(m: Measurement) -> None:
        r, position, wanted, velocity = m.reference_position, m.position, m.reference_velocity, m.velocity
        error = [r.x - position.x, r.y - position.y, r.z - m.deflection]
        rate = [wanted.x - velocity.x, wanted.y - velocity.y, wanted.z - velocity.z]
        runs.append(m.run_id)
        for each in wrong.answers(m.sequence, position.x, error, rate):
            time.sleep(each.after)
            drive = PiezoDrive(header=m.header if each.stamped else Header(), sequence=each.sequence)
            drive.header.frame_id = each.frame
            drive.run_id = runs[0] if each.first_run else m.run_id
            drive.voltage = Vector3(**dict(zip("xyz", each.drive, strict=True)))
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
