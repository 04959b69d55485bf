"""A scan as it grows: line by line, and as images now and then."""

import array
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from afm_msgs.msg import ScanLine
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import Image as ImageMessage

from afm_model.microscope.results import DIRECTIONS, Line
from afm_model.microscope.verbs import Scan
from afm_node_common import topics

from .streams import stamp

IMAGE_PERIOD = 0.5
"""Wall time between two messages of one image [s]."""


class ScanLines:
    """Publishes each line of a scan, and images of all that was measured up to then.

    Parameters
    ----------
    node : Node

    What waits to be published is published by `publish_one`, in the time that a tick leaves.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._lines = node.create_publisher(ScanLine, topics.SCAN_LINE, topics.SCAN_LINE_QOS)
        self._publishers: dict[tuple[str, str], Any] = {}
        self._images: dict[tuple[str, str], NDArray[np.float32]] = {}
        self._changed: dict[tuple[str, str], float] = {}  # wall time at which each is due [s]
        self._published_at: dict[tuple[str, str], float] = {}
        self._scan, self._units = Scan(), dict[str, str]()
        self._stamp_ns = 0
        self.number = 0
        """Of the scan."""

    def begin(self, scan: Scan, units: Mapping[str, str]) -> None:
        """A scan begins; `units` are those of its channels."""
        self.number += 1
        self._scan, self._units = scan, dict(units)
        self._changed.clear()
        self._images = {
            (name, way): np.full((scan.lines, scan.pixels), np.nan, np.float32) for name in units for way in DIRECTIONS
        }
        for name, way in self._images:
            if (name, way) not in self._publishers:
                topic = f"{topics.IMAGE}/{name.replace('/', '_')}_{way}"
                self._publishers[name, way] = self._node.create_publisher(ImageMessage, topic, topics.LATCHED_QOS)

    def put(self, line: Line) -> None:
        """A line has been measured."""
        scan = self._scan
        row = line.index if scan.direction == "up" else scan.lines - 1 - line.index
        data = np.concatenate(list(line.channels.values()))
        self._stamp_ns = round(line.time * 1e9)
        message = ScanLine(
            scan=self.number,
            index=line.index,
            direction=line.direction,
            lines=scan.lines,
            pixels=scan.pixels,
            centre_x=scan.centre_x,
            centre_y=scan.centre_y,
            size_x=scan.size_x,
            size_y=scan.height,
            angle=scan.angle,
            up=scan.direction == "up",
            slow_axis=scan.slow_axis,
            line_rate=scan.line_rate,
            overscan=scan.overscan,
            speed=scan.speed,
            row=row,
            time=line.time,
            channels=list(line.channels),
            units=[self._units[name] for name in line.channels],
            data=array.array("d", data.tobytes()),
        )
        message.header.frame_id = topics.FRAME
        message.header.stamp = stamp(self._stamp_ns)
        self._lines.publish(message)
        for name, values in line.channels.items():
            key = name, line.direction
            self._images[key][row] = values
            self._changed.setdefault(key, self._published_at.get(key, -np.inf) + IMAGE_PERIOD)

    def end(self) -> None:
        """A scan has come to its end: publish what has not been."""
        self.publish_images(force=True)

    def publish_images(self, *, force: bool = False) -> None:
        """Publish one image that is due; all that have changed if `force`."""
        now = time.monotonic()
        due = [key for key, at in self._changed.items() if force or now >= at]
        for key in due if force else due[:1]:
            del self._changed[key]
            self._published_at[key] = now
            # The last one is kept for whoever comes late.
            if force or self._publishers[key].get_subscription_count():
                self._publishers[key].publish(self._image(self._images[key]))

    def _image(self, values: NDArray[np.float32]) -> Any:
        """Rows of an Image go from the top down: the first one is at the largest y."""
        rows, columns = values.shape
        data = np.ascontiguousarray(values[::-1], "<f4").tobytes()
        message = ImageMessage(
            height=rows, width=columns, encoding="32FC1", is_bigendian=0, step=4 * columns, data=array.array("B", data)
        )
        message.header.frame_id = topics.FRAME
        message.header.stamp = stamp(self._stamp_ns)
        return message
