"""Run by test_action_server: simulator and controller in one process, with an action server that comes later."""

import sys

from rclpy.action import ActionServer
from rclpy.action.server import ServerGoalHandle
from test_msgs.action import Fibonacci

from afm_controller_node.node import ControllerNode
from afm_node_common.process import ControllerNodeParameters, SimNodeParameters
from afm_node_common.runner import run_together
from afm_sim_node.node import SimNode


class ServingSimNode(SimNode):
    """Answers a goal with the number of ticks made until then."""

    def __init__(self) -> None:
        super().__init__()
        self._later = self.create_timer(0.2, self._begin_to_serve)
        self.served = 0

    def _begin_to_serve(self) -> None:
        # The loop has long begun.
        self.destroy_timer(self._later)
        self._server = ActionServer(self, Fibonacci, "count", self._execute)

    def destroy_node(self) -> None:
        """End the node."""
        self._server.destroy()  # rclpy does not destroy it with the node
        super().destroy_node()

    async def _execute(self, goal: ServerGoalHandle) -> Fibonacci.Result:
        self.served += 1
        goal.succeed()
        return Fibonacci.Result(sequence=[self.run.instrument.ticks, self.served])


if __name__ == "__main__":
    sys.exit(run_together([(ServingSimNode, SimNodeParameters), (ControllerNode, ControllerNodeParameters)]))
