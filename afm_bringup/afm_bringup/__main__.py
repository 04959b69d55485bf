"""Entry points of `ros2 run afm_bringup session` (also `python -m afm_bringup`) and `ros2 run afm_bringup composed`."""

import sys

from afm_node_common.entry import start


def session() -> int:
    """Exit code of a session; see `afm_bringup.session`."""
    return start("afm_bringup.session")


def composed() -> int:
    """Exit code of simulator and controller in one process; see `afm_bringup.composed`."""
    return start("afm_bringup.composed")


if __name__ == "__main__":
    sys.exit(session())
