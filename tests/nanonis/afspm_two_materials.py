"""An experiment by afspm alone, run by its Python: friction by a scan, then force curves on both materials.

Prints the numbers of each side as JSON.
"""

import json
import math
import sys
from collections.abc import Iterator

import numpy as np
import zmq
from afspm.components.microscope.params import MicroscopeParameter
from afspm.io.control.client import ControlClient
from afspm.io.protos.generated import control_pb2, scan_pb2, spec_pb2
from afspm.io.pubsub.logic.cache_logic import CacheLogic
from afspm.io.pubsub.subscriber import Subscriber

PUBLISHED, ROUTER = "tcp://127.0.0.1:7778", "tcp://127.0.0.1:7779"
WIDTH, HEIGHT, PIXELS, LINES = 400.0, 80.0, 64, 64  # Its reader of scans takes square images only.
CURVES, TRIGGER, STEP = 4, 6.0, 0.1e-9
POLL = 60_000
"""Longest time between two messages [ms]."""


def done(answer: int) -> None:
    if answer != control_pb2.ControlResponse.REP_SUCCESS:
        raise RuntimeError(control_pb2.ControlResponse.Name(answer))


def listen(message: object) -> Subscriber:
    return Subscriber(PUBLISHED, topics_to_sub=[CacheLogic.get_envelope_for_proto(message)], poll_timeout_ms=POLL)


def received(subscriber: Subscriber) -> list:
    messages = subscriber.poll_and_store()
    if not messages:
        raise RuntimeError(f"nothing came within {POLL} ms")
    return [message for _, message in messages]


def states() -> Iterator[int]:
    subscriber = listen(scan_pb2.ScopeStateMsg())
    while True:
        yield from (message.scope_state for message in received(subscriber))


def wait_for(states: Iterator[int], begun: int) -> None:
    """Wait until what was asked for has begun and is over: a request that comes earlier can be lost."""
    for wanted in (begun, scan_pb2.ScopeState.SS_FREE):
        while next(states) != wanted:
            pass


def friction(client: ControlClient, states: Iterator[int], scans: Subscriber) -> np.ndarray:
    """Half the difference of trace and retrace [V] (line, pixel) of a scan."""
    frame = scan_pb2.ScanParameters2d()
    frame.spatial.roi.top_left.x, frame.spatial.roi.top_left.y = -0.5 * WIDTH, -0.5 * HEIGHT
    frame.spatial.roi.size.x, frame.spatial.roi.size.y = WIDTH, HEIGHT
    frame.spatial.length_units, frame.spatial.angular_units = "nm", "deg"
    frame.data.shape.x, frame.data.shape.y = PIXELS, LINES
    done(client.set_scan_params(frame))
    wait_for(states, scan_pb2.ScopeState.SS_MOVING)
    speed = control_pb2.ParameterMsg(parameter=MicroscopeParameter.SCAN_SPEED, value="3800", units="nm/s")
    done(client.request_parameter(speed)[0])
    done(client.start_scan())
    wait_for(states, scan_pb2.ScopeState.SS_SCANNING)
    found = []
    while len(found) < 2:
        found += [scan for scan in received(scans) if "Horiz" in scan.channel]
    lines = [np.reshape(scan.values, (LINES, PIXELS)) for scan in found]
    return 0.5 * (lines[0] - lines[1])


def curve(client: ControlClient, states: Iterator[int], specs: Subscriber) -> tuple[float, float]:
    """Sensitivity [m/V] and pull-off [V] of one force curve."""
    done(client.start_spec())
    wait_for(states, scan_pb2.ScopeState.SS_SPEC)
    data = received(specs)[-1].data
    rows = np.reshape(data.values, (data.num_variables, data.data_per_variable))
    z, towards, _, away = rows
    pressed = (towards > 0.3 * TRIGGER) & (towards < 0.9 * TRIGGER)
    free = np.nanmean(towards[: len(towards) // 10])
    return -1.0 / np.polyfit(z[pressed], towards[pressed], 1)[0], free - np.nanmin(away)


def mean(numbers: object) -> tuple[float, float]:
    return float(np.mean(numbers)), float(np.std(numbers, ddof=1)) / math.sqrt(len(numbers))


def main() -> None:
    client = ControlClient(ROUTER, zmq.Context.instance(), "TwoMaterials", request_timeout_ms=POLL)
    scans, specs, scope = listen(scan_pb2.Scan2d()), listen(spec_pb2.Spec1d()), states()
    next(scope)  # The last state is sent to who listens: from now on it hears all.
    done(client.request_control(control_pb2.ExperimentProblem.EP_NONE))
    strong = friction(client, scope, scans)
    x = WIDTH * ((np.arange(PIXELS) + 0.5) / PIXELS - 0.5)
    found = {}
    for side, place in (("left", -40.0), ("right", 40.0)):
        position = spec_pb2.ProbePosition(units="nm")
        position.point.x = place
        done(client.set_probe_pos(position))
        wait_for(scope, scan_pb2.ScopeState.SS_MOVING)
        slopes, pulls = zip(*(curve(client, scope, specs) for _ in range(CURVES)), strict=True)
        near = strong[:, np.abs(x - place) < 20.0].mean(axis=1)
        sensitivity, (pull, error) = mean(slopes), mean(pulls)
        # The tip leaves the sample somewhere within a step of z.
        pull_off = pull, math.hypot(error, STEP / sensitivity[0] / math.sqrt(12.0))
        found[side] = {"friction": mean(near), "sensitivity": sensitivity, "pull_off": pull_off}
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
