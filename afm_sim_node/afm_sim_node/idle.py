"""What the simulator does until its next tick."""

import time

from afm_model.run import Run
from afm_node_common.parameters import Declared
from afm_node_common.process import SimNodeParameters

from .declared import wall_period
from .inside_link import InsideLink
from .streams import Streams
from .topic_link import TopicLink

_ROOM = 0.1
"""Part of a period that must be left before a deadline for a message of the streams to be published.

One may take longer than what is left: the next tick is then late, and the ticks after it make up for it before another
message goes out.
"""


class Idle:
    """Work on blocks and streams where there is time for it, then sleep.

    Parameters
    ----------
    run : Run
    link : TopicLink or InsideLink
    streams : Streams
    declared : Declared
    """

    def __init__(
        self, run: Run, link: TopicLink | InsideLink, streams: Streams, declared: Declared[SimNodeParameters]
    ) -> None:
        self._run, self._link, self._streams, self._declared = run, link, streams, declared

    def wait(self, timeout: float) -> None:
        """Sleep until a drive or a deadline, or for `timeout` seconds of wall time."""
        run, streams = self._run, self._streams
        if not run.ticking:
            while run.blocks.do_one():
                pass
            streams.publish_all()
            time.sleep(timeout)
        elif (deadline := run.deadline) is None:
            self._link.wait(timeout)
        else:
            left, parameters = deadline - time.monotonic(), self._declared.current
            if left > _ROOM * wall_period(parameters):
                if run.blocks.do_one():
                    return
                if streams.waiting:
                    streams.publish_one()
                    return
            left -= parameters.run.spin_time
            if left > 0.0:
                time.sleep(min(left, timeout))
