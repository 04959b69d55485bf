"""A controller of your own: proportional-derivative tracking of x and y, the z drive left as it is."""

import rclpy
from afm_msgs.msg import Measurement, PiezoDrive
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class PdController(Node):
    """Answers every measurement with one drive that carries the same sequence."""

    def __init__(self):
        super().__init__("pd_controller", namespace="afm")
        self.drive = self.create_publisher(PiezoDrive, "piezo_drive", 10)
        self.create_subscription(Measurement, "measurement", self.on_measurement, 10)

    def on_measurement(self, m):
        answer = PiezoDrive(header=m.header, sequence=m.sequence)
        answer.voltage.z = m.drive.z
        for axis in "xy":
            error = getattr(m.reference_position, axis) - getattr(m.position, axis)  # [m]
            rate = getattr(m.reference_velocity, axis) - getattr(m.velocity, axis)  # [m/s]
            setattr(answer.voltage, axis, 3e10 * error + 6e5 * rate)  # [V/m], [V s/m]
        self.drive.publish(answer)


def main():
    rclpy.init()
    try:
        rclpy.spin(PdController())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
