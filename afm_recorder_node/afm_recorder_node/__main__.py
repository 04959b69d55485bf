"""Entry point of `ros2 run afm_recorder_node afm_recorder_node`."""

import os
import sys

from afm_node_common.entry import start


def main() -> int:
    """Exit code; see `afm_node_common.runner`."""
    # Before rerun is loaded: its allocator would keep what its threads have freed until it is called from them again,
    # which those of a complete recording never do.
    os.environ.setdefault("MIMALLOC_PURGE_DELAY", "0")
    return start("afm_recorder_node.node")


if __name__ == "__main__":
    sys.exit(main())
