"""A controller that is a managed (lifecycle) node and not active is named, and a run does not start with it."""

from afm_msgs.msg import InstrumentStatus, Measurement, PiezoDrive
from rclpy.lifecycle import LifecycleNode, State, TransitionCallbackReturn
from support import Graph, Observer

from afm_node_common import topics
from afm_sim_node.node import SimNode


class Careful(LifecycleNode):
    """Holds the drive of the start, while it is active."""

    def __init__(self) -> None:
        super().__init__("careful", namespace=topics.NAMESPACE)

    def on_configure(self, state: State) -> TransitionCallbackReturn:
        self._drives = self.create_lifecycle_publisher(PiezoDrive, topics.PIEZO_DRIVE, topics.CONTROL_QOS)
        self.create_subscription(Measurement, topics.MEASUREMENT, self._answer, topics.CONTROL_QOS)
        return TransitionCallbackReturn.SUCCESS

    def _answer(self, measurement: Measurement) -> None:
        self._drives.publish(PiezoDrive(sequence=measurement.sequence, voltage=measurement.drive))


def test_managed_controller_that_is_not_active_is_named_until_it_is_and_then_the_run_starts() -> None:
    with Graph(["--ros-args", "-p", "run.lockstep_timeout:=1.0"]) as graph:
        observer = graph.add(Observer())
        graph.add(SimNode())
        careful = graph.add(Careful())
        said = "/afm/careful is a managed (lifecycle) node in state"
        graph.spin_until(lambda: f"{said} unconfigured" in observer.status.detail)
        careful.trigger_configure()
        graph.spin_until(lambda: f"{said} inactive" in observer.status.detail)
        graph.spin_until(lambda: observer.status.controllers)
        assert observer.status.state == InstrumentStatus.WAITING and observer.status.ticks == 0
        careful.trigger_activate()
        graph.spin_until(lambda: observer.status.ticks > 100)
        assert observer.status.detail == ""
        careful.trigger_deactivate()
        graph.spin_until(lambda: f"{said} inactive" in observer.status.warning)
        assert observer.status.state == InstrumentStatus.STALLED
