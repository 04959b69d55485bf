"""A health check: `health.py NODE` ends with 0 if a node of this name is seen on the network within five seconds."""

import sys
import time

import rclpy


def main() -> int:
    """The exit code."""
    rclpy.init()
    node = rclpy.create_node("health", enable_rosout=False, start_parameter_services=False)
    end = time.monotonic() + 5.0
    while sys.argv[1] not in node.get_node_names():
        if time.monotonic() > end:
            return 1
        time.sleep(0.1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
