"""Entry points of `ros2 run afm_bringup ...`, each the main of a module; `python -m afm_bringup` is `session`."""

import sys
from functools import partial

from afm_node_common.entry import start

session = partial(start, "afm_bringup.session_command")
compare = partial(start, "afm_bringup.compare_command")
composed = partial(start, "afm_bringup.composed")
contained = partial(start, "afm_bringup.contained")
scan = partial(start, "afm_bringup.scan_command")
scorecard = partial(start, "afm_bringup.score_command")
check_scenario = partial(start, "afm_bringup.check_command")
check_controller = partial(start, "afm_bringup.controller_command")
identify = partial(start, "afm_bringup.identify_command")
joint_bridge = partial(start, "afm_bringup.joint_bridge")
replay = partial(start, "afm_bringup.replay_command")

if __name__ == "__main__":
    sys.exit(session())
