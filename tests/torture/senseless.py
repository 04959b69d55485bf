"""Messages to a recorder that cannot be read, or make no sense whatever their numbers."""

import math
from collections.abc import Callable
from random import Random
from typing import Any

from afm_msgs.msg import ControlTrace, InstrumentStatus, Score, Waveform
from rcl_interfaces.msg import Parameter, ParameterEvent
from rclpy.serialization import serialize_message

from afm_node_common import topics

EVENTS = "/parameter_events"
_NO_PERIODS = (math.nan, math.inf, -math.inf, 0.0, -1.0)
_Spoil = Callable[[Random, Any], None]


def _trace(rng: Random) -> ControlTrace:
    count = rng.randrange(1, 20)
    numbers = [rng.gauss(0.0, 1.0) for _ in range(3 * count)]
    return ControlTrace(
        control_period=1e-6,
        position=numbers,
        reference_position=numbers,
        deflection=numbers[:count],
        drive=numbers,
        round_trip=numbers[:count],
    )


def _wave(rng: Random) -> Waveform:
    samples = [rng.gauss(0.0, 1.0) for _ in range(rng.randrange(1, 40))]
    return Waveform(sample_period=1e-6, scale=1.0, unit="m", samples=samples)


def _event(rng: Random) -> ParameterEvent:
    event = ParameterEvent(node=f"/{rng.getrandbits(32)}", new_parameters=[Parameter(name="x")])
    event.new_parameters[0].value.type = rng.randrange(10, 256)
    return event


def _stamp(rng: Random, message: Any) -> None:
    if rng.random() < 0.5:
        message.header.stamp.sec = rng.randrange(-(2**31), 0)
    else:
        message.header.stamp.nanosec = rng.randrange(10**9, 2**32)


def _length(rng: Random, trace: Any) -> None:
    name = rng.choice(["position", "reference_position", "drive", "round_trip"])
    count = len(getattr(trace, name))
    setattr(trace, name, [0.0] * rng.choice([n for n in (0, 1, 2, count - 1, count + 1, 3 * count + 2) if n != count]))


def _period(rng: Random, message: Any) -> None:
    name = "control_period" if isinstance(message, ControlTrace) else "sample_period"
    setattr(message, name, rng.choice([*_NO_PERIODS, -rng.random()]))


def _first(rng: Random, message: Any) -> None:
    name = "first_sequence" if isinstance(message, ControlTrace) else "first_sample"
    # A number that is not that of its stamp, 0; or one beyond what a recording holds.
    setattr(message, name, rng.choice([rng.randrange(10, 2**63), rng.randrange(2**63, 2**64)]))


def _scale(rng: Random, wave: Any) -> None:
    wave.scale = rng.choice([math.nan, math.inf, 0.0])


def _unit(rng: Random, wave: Any) -> None:
    wave.unit = rng.choice(["N", "", "nm", "x" * rng.randrange(1, 300)])


_BLOCK: list[_Spoil] = [_stamp, _period, _first]
KINDS: dict[str, tuple[Callable[[Random], Any], list[_Spoil]]] = {
    topics.CONTROL_TRACE: (_trace, [*_BLOCK, _length]),
    topics.DEFLECTION: (_wave, [*_BLOCK, _scale, _unit]),
    topics.STATUS: (lambda rng: InstrumentStatus(detail="x" * rng.randrange(50)), [_stamp]),
    topics.SCORE: (lambda rng: Score(ticks=rng.getrandbits(64)), [_stamp]),
    EVENTS: (_event, [lambda rng, event: None]),
}
"""By topic: what makes a message, and what makes nonsense of it."""


def senseless(rng: Random, topic: str) -> bytes:
    """A message on a topic of KINDS that the recorder has to drop."""
    make, spoils = KINDS[topic]
    message = make(rng)
    kind = rng.randrange(4)
    if kind == 0:  # no encapsulation that there is
        return bytes([rng.randrange(1, 256), rng.randrange(256)]) + rng.randbytes(rng.randrange(200))
    if kind == 1:  # broken off by more than the padding at the end
        data = serialize_message(message)
        return data[: rng.randrange(2, len(data) - 4)]
    rng.choice(spoils)(rng, message)
    return serialize_message(message)
