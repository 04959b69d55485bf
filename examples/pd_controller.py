"""A controller of your own: proportional-derivative tracking of the scanner's x and y and of the tip's height z."""

try:
    import rclpy
    from afm_msgs.msg import Measurement, PiezoDrive
    from rclpy.executors import ExternalShutdownException
    from rclpy.node import Node
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error}: run `. ./env.sh` in the folder of the clone first, once per terminal") from None

# Along z those of the tanh law for small errors. [V/m], [V s/m]
GAINS = {"x": (3e10, 6e5), "y": (3e10, 6e5), "z": (5.2e8, 8.4e4)}


class PdController(Node):
    """Answers every measurement with one drive that carries the same sequence."""

    def __init__(self):
        super().__init__("pd_controller", namespace="afm")
        self.drive = self.create_publisher(PiezoDrive, "piezo_drive", 10)
        self.create_subscription(Measurement, "measurement", self.on_measurement, 10)

    def on_measurement(self, m):
        answer = PiezoDrive(header=m.header, run_id=m.run_id, sequence=m.sequence)
        for axis, (gain, damping) in GAINS.items():
            # The height of the tip is the deflection, as long as cantilever.a is 0.
            position = m.deflection if axis == "z" else getattr(m.position, axis)
            error = getattr(m.reference_position, axis) - position  # [m]
            rate = getattr(m.reference_velocity, axis) - getattr(m.velocity, axis)  # [m/s]
            setattr(answer.voltage, axis, gain * error + damping * rate)
        self.drive.publish(answer)


def main():
    rclpy.init()
    try:
        rclpy.spin(PdController())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
