"""A controller that looks ahead, as a node: it asks the simulator for the reference, some seconds of it at a time.

The law is that of examples/controllers/preview_class.py, for the scanner and the piezo of the default instrument.
"""

import sys
from pathlib import Path

try:
    import numpy as np
    import rclpy
    from afm_msgs.msg import Measurement, PiezoDrive
    from afm_msgs.srv import PreviewReference
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.node import Node

    from afm_model import SimParameters, changed
except ModuleNotFoundError as error:
    raise SystemExit(f"error: {error}: run `. ./env.sh` in the folder of the clone first, once per terminal") from None

sys.path.insert(0, str(Path(__file__).parent / "controllers"))
from preview_class import Feedforward

MOST = PreviewReference.Request.MOST
PAGE = MOST - 64
"""Ticks of a page; it also has the first ones of its successor."""


def xy(vector):
    """Two numbers of a message."""
    return np.array([vector.x, vector.y])


class PreviewController(Node):
    """Answers a measurement as soon as the reference is known there and as far ahead as its drive acts."""

    def __init__(self):
        super().__init__("preview_controller", namespace="afm")
        self.delay = self.declare_parameter("law.delay_ticks", 0).value
        self.problem, self.pages, self.asked, self.law, self.waiting, self.last = "", {}, set(), None, None, -1
        self.client = self.create_client(PreviewReference, "preview_reference")
        self.drive = self.create_publisher(PiezoDrive, "piezo_drive", 10)
        self.create_subscription(Measurement, "measurement", self.on_measurement, 10)

    def on_measurement(self, m):
        if m.sequence < self.last:  # a reset, or another simulator, which may have another reference
            self.pages, self.asked, self.law = {}, set(), None
        self.waiting, self.last = m, m.sequence
        self.answer()

    def ask(self, page):
        """Ask for a page, once. Before the service has been found the question would be lost."""
        if page not in self.asked and self.client.service_is_ready():
            self.asked.add(page)
            request = PreviewReference.Request(first=page * PAGE, count=MOST)
            self.client.call_async(request).add_done_callback(lambda future: self.on_preview(page, future.result()))

    def on_preview(self, page, preview):
        if not preview.success:
            self.problem = preview.message
            return
        if self.law is None:
            timing = {"plant.control_period": preview.period, "plant.delay_ticks": self.delay}
            self.law = Feedforward(changed(SimParameters(), timing))
        values = (np.array(each).reshape(MOST, 3)[:, :2] for each in (preview.position, preview.velocity))
        self.pages[page] = list(zip(*values, strict=True))
        self.answer()

    def answer(self):
        if self.waiting is None:
            return
        m, (page, i) = self.waiting, divmod(self.waiting.sequence, PAGE)
        self.ask(page)
        if page not in self.pages or self.law is None:
            return
        if i > PAGE // 2:
            self.ask(page + 1)
            self.pages.pop(page - 1, None)
        (r, v), now, then = (self.pages[page][i + n] for n in (0, self.delay, self.delay + 1))
        u = self.law.drive(r - xy(m.position), v - xy(m.velocity), m.lateral_force, now, then, m.drive.z)
        answer = PiezoDrive(header=m.header, run_id=m.run_id, sequence=m.sequence)
        answer.voltage.x, answer.voltage.y, answer.voltage.z = map(float, u)
        self.waiting = None
        self.drive.publish(answer)


def main():
    rclpy.init()
    node, executor = PreviewController(), SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not node.problem:
            executor.spin_once()
    except (KeyboardInterrupt, ExternalShutdownException):
        return
    raise SystemExit(f"error: {node.problem}")


if __name__ == "__main__":
    main()
