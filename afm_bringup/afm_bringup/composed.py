"""`ros2 run afm_bringup composed`: simulator and controller in one process, still two nodes on the same topics.

A message then costs no wake-up of another process, which is what bounds the loop between two.
"""

from afm_controller_node.node import ControllerNode
from afm_node_common.process import ControllerNodeParameters, SimNodeParameters
from afm_node_common.runner import run_together
from afm_sim_node.node import SimNode


def main() -> int:
    """Entry point."""
    return run_together([(SimNode, SimNodeParameters), (ControllerNode, ControllerNodeParameters)])
