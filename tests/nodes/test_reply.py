"""The compiled reply to a measurement is the message that codecs and law give, bit by bit; all else is left to them."""

import struct

import numpy as np
import pytest

from afm_controller_node.reply import Reply
from afm_model import Controller, ControllerParameters, build
from afm_model.compiled.records import size
from afm_model.parts.signals import Measurement
from afm_node_common.cdr import measurement_codec
from afm_node_common.drive_codec import drive_codec

MEASUREMENTS, DRIVES = measurement_codec(), drive_codec()
SEED, RUN = 20, 1_700_000_000_000_003
NUMBERS = np.linspace(-1e-9, 1e-9, size(Measurement))


def law(kind: str = "tanh", **values: int) -> Controller:
    named = {f"law.{name}": value for name, value in values.items()}
    return Controller(build(ControllerParameters, {"law.kind": kind} | named))


def test_reply_is_what_codecs_and_law_give() -> None:
    # A law with a state: it takes one step for each measurement.
    controller, other = law("observer"), law("observer")
    reply, generator, sequence = Reply(controller), np.random.default_rng(SEED), -1
    controller.reset()
    reply.begin(RUN)
    for count in range(1, 200):
        sequence += 1 + int(generator.exponential(2.0**count % 2**50))
        values, stamp = NUMBERS * generator.standard_normal(NUMBERS.size), int(generator.integers(2**31 * 10**9))
        data = bytearray(MEASUREMENTS.encode(RUN, sequence, stamp, values))
        data[24:28] = generator.bytes(4)  # padding: anything
        assert reply.answer(bytes(data))
        assert reply.drive == DRIVES.encode(RUN, sequence, stamp, other.answer(values, stamp * 1e-9))
        assert (reply.answered, reply.answers) == (sequence, count)


WHOLE = MEASUREMENTS.encode(RUN, 7, 3 * 10**9 + 21, NUMBERS)
OTHERS = {
    "one that comes again": MEASUREMENTS.encode(RUN, 6, 0, NUMBERS),
    "one of another run": MEASUREMENTS.encode(RUN + 1, 7, 0, NUMBERS),
    "another length": WHOLE + b"\0",
    "another byte order": b"\0\0" + WHOLE[2:],
    "another frame": WHOLE[:16] + b"S" + WHOLE[17:],
    "a frame of another length": WHOLE[:12] + struct.pack("<I", 7) + WHOLE[16:],
    "a time before the start": WHOLE[:4] + struct.pack("<i", -1) + WHOLE[8:],
    "a second of more nanoseconds": WHOLE[:8] + struct.pack("<I", 10**9) + WHOLE[12:],
    "a sequence beyond": WHOLE[:36] + struct.pack("<Q", 2**64 - 1) + WHOLE[44:],
}


@pytest.mark.parametrize("data", OTHERS.values(), ids=OTHERS)
def test_any_other_message_is_left_to_the_codecs_and_the_law_does_not_see_it(data: bytes) -> None:
    controller = law()
    reply = Reply(controller)
    reply.begin(RUN)
    reply.note(6)
    before, drive = controller.written.copy(), bytes(reply.drive)
    assert not reply.answer(data)
    assert (reply.answered, reply.answers, bytes(reply.drive)) == (6, 1, drive)
    assert np.array_equal(controller.written, before)
    assert reply.answer(WHOLE)


def test_answer_with_a_horizon_is_left_to_the_codec_and_the_law_has_seen_the_measurement_once() -> None:
    controller, other = law("predictive", packet=4), law("predictive", packet=4)
    reply = Reply(controller)
    controller.reset()
    reply.begin(RUN)
    assert not reply.answer(WHOLE)
    assert (reply.answered, reply.answers) == (7, 1)
    assert DRIVES.encode(RUN, 7, 0, controller.given()) == DRIVES.encode(RUN, 7, 0, other.answer(NUMBERS, 3 + 21e-9))
