"""Controllers that a test writes by hand: a node with a law of its own, and the loop without anything between."""

from collections.abc import Callable, Sequence
from typing import Any

from afm_msgs.msg import Measurement, PiezoDrive
from rclpy.node import Node

from afm_model import Controller, Instrument
from afm_node_common import topics


class HandController(Node):
    """A controller as a user writes it: typed messages, one subscription, one publisher.

    Parameters
    ----------
    law : callable
        Answers a measurement with drives to publish, in order.
    """

    def __init__(
        self, law: Callable[[Measurement], Sequence[PiezoDrive]], name: str = "hand_made", record: bool = True
    ) -> None:
        super().__init__(name, namespace=topics.NAMESPACE)
        self.law = law
        self.seen: list[Measurement] = []
        self._record = record
        self._publisher = self.create_publisher(PiezoDrive, topics.PIEZO_DRIVE, topics.CONTROL_QOS)
        self.create_subscription(Measurement, topics.MEASUREMENT, self._on_measurement, topics.CONTROL_QOS)

    @property
    def told(self) -> str:
        """For messages of tests that fail."""
        return f"controller has seen measurements up to {self.seen[-1].sequence if self.seen else None}"

    def _on_measurement(self, measurement: Measurement) -> None:
        # The simulator sends one again that is not answered within a second: on a machine that stands still, any.
        if self._record and measurement not in self.seen[-1:]:
            self.seen.append(measurement)
        for drive in self.law(measurement):
            self._publisher.publish(drive)


def answer(measurement: Measurement, x: float, y: float, z: float | None = None, ahead: int = 0) -> PiezoDrive:
    """A drive for a measurement, or for one `ahead` of it; without `z` the z drive stays what it is."""
    drive = PiezoDrive(header=measurement.header, run_id=measurement.run_id, sequence=measurement.sequence + ahead)
    drive.voltage.x, drive.voltage.y = x, y
    drive.voltage.z = measurement.drive.z if z is None else z
    return drive


def run_in_process(instrument: Instrument, law: Callable[[Any], Any] | Controller, ticks: int) -> Instrument:
    """The loop of instrument and law without anything between them."""
    answer_to = law.answer if isinstance(law, Controller) else law
    for _ in range(ticks):
        if instrument.block_full:
            instrument.take_block()
        instrument.tick(answer_to(instrument.measurement))
    return instrument
