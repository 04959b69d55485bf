"""Entry points of `ros2 run afm_bringup ...`; `python -m afm_bringup` is `session`."""

import sys

from afm_node_common.entry import start


def session() -> int:
    """Exit code of a session; see `afm_bringup.command`."""
    return start("afm_bringup.command")


def compare() -> int:
    """Exit code of a comparison of laws; see `afm_bringup.compare_command`."""
    return start("afm_bringup.compare_command")


def composed() -> int:
    """Exit code of simulator and controller in one process; see `afm_bringup.composed`."""
    return start("afm_bringup.composed")


def scan() -> int:
    """Exit code of making an image; see `afm_bringup.scan_command`."""
    return start("afm_bringup.scan_command")


def scorecard() -> int:
    """Exit code of following a run to its score; see `afm_bringup.score_command`."""
    return start("afm_bringup.score_command")


def check_scenario() -> int:
    """Exit code of checking a scenario; see `afm_bringup.check_command`."""
    return start("afm_bringup.check_command")


def check_controller() -> int:
    """Exit code of examining a controller; see `afm_bringup.controller_command`."""
    return start("afm_bringup.controller_command")


def identify() -> int:
    """Exit code of identifying the scanner; see `afm_bringup.identify_command`."""
    return start("afm_bringup.identify_command")


def replay() -> int:
    """Exit code of playing a recorded run again; see `afm_bringup.replay_command`."""
    return start("afm_bringup.replay_command")


if __name__ == "__main__":
    sys.exit(session())
