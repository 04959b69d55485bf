"""Entry point of `ros2 run afm_recorder_node afm_recorder_node`."""

import sys

from afm_node_common.entry import start


def main() -> int:
    """Exit code; see `afm_node_common.runner`."""
    return start("afm_recorder_node.node")


if __name__ == "__main__":
    sys.exit(main())
