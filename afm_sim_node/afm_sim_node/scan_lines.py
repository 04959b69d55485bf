"""A scan as it grows: line by line, and as images now and then."""

import array
import time
from typing import Any

import numpy as np
from afm_msgs.msg import ScanLine
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import Image as ImageMessage

from afm_model.microscope.image import Image, Line
from afm_node_common import topics
from afm_node_common.decoding import FRAME
from afm_node_common.stamps import stamp
from afm_node_common.verb_codec import numbers

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
        self._image: Image | None = None
        self._changed: dict[tuple[str, str], float] = {}  # wall time at which each is due [s]
        self._published_at: dict[tuple[str, str], float] = {}
        self._stamp_ns = 0
        self.number = 0
        """Of the scan."""

    def begin(self) -> None:
        """A scan begins."""
        self.number += 1
        self._image = None
        self._changed.clear()

    def put(self, run_id: int, line: Line, image: Image) -> None:
        """A line has been measured in this run, and stands in the image of its scan."""
        if self._image is None:
            self._begin_images(image)
        scan, row = image.scan, image.row(line.index)
        self._stamp_ns = round(line.time * 1e9)
        same = {name: getattr(scan, name) for name in FRAME}
        message = ScanLine(
            **same,
            run_id=run_id,
            scan=self.number,
            index=line.index,
            direction=line.direction,
            size_y=scan.height,
            up=scan.direction == "up",
            row=row,
            channels=list(line.channels),
            units=[image.units[name] for name in line.channels],
            data=numbers(*line.channels.values()),
        )
        message.header.frame_id = topics.FRAME
        message.header.stamp = stamp(self._stamp_ns)
        self._lines.publish(message)
        for name in line.channels:
            key = name, line.direction
            self._changed.setdefault(key, self._published_at.get(key, -np.inf) + IMAGE_PERIOD)

    def _begin_images(self, image: Image) -> None:
        self._image = image
        for name, way in image.data:
            if (name, way) not in self._publishers:
                topic = f"{topics.IMAGE}/{name.replace('/', '_')}_{way}"
                self._publishers[name, way] = self._node.create_publisher(ImageMessage, topic, topics.LATCHED_QOS)

    def end(self) -> None:
        """A scan has come to its end: publish what has not been."""
        self.publish_images(force=True)

    def publish_images(self, *, force: bool = False) -> None:
        """Publish one image that is due; all that have changed if `force`."""
        now = time.monotonic()
        if self._image is None:
            return
        due = [key for key, at in self._changed.items() if force or now >= at]
        for key in due if force else due[:1]:
            del self._changed[key]
            self._published_at[key] = now
            # The last one is kept for whoever comes late.
            if force or self._publishers[key].get_subscription_count():
                self._publishers[key].publish(self._message(self._image.data[key]))

    def _message(self, values: NDArray[np.float64]) -> Any:
        """Rows of an Image go from the top down: the first one is at the largest y."""
        rows, columns = values.shape
        data = np.ascontiguousarray(values[::-1], "<f4").tobytes()
        message = ImageMessage(
            height=rows, width=columns, encoding="32FC1", is_bigendian=0, step=4 * columns, data=array.array("B", data)
        )
        message.header.frame_id = topics.FRAME
        message.header.stamp = stamp(self._stamp_ns)
        return message
