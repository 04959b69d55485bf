"""A measurement answered in one compiled call: from the bytes of the one message to those of the other.

For messages that are laid out as those of our simulator, and answers without a horizon; the codecs do all others.
"""

import ctypes

import numpy as np

from afm_model import Controller
from afm_model.compiled.jit import kernel
from afm_model.compiled.records import Block, Integers, record_at, size
from afm_model.parts.dispatch import control
from afm_model.parts.signals import Drive, Measurement, PiezoDrive
from afm_node_common.cdr import measurement_codec
from afm_node_common.decoding import NANOSECONDS
from afm_node_common.drive_codec import drive_codec
from afm_node_common.topics import FRAME

_ORIGIN = 4
"""Bytes of a message before its first word of 8: CDR aligns from there on."""


@kernel
def reply(law: Block, words: Integers, sent: Integers, answer: Block) -> bool:
    """Answer the message in `words` by the one in `sent`; False if it is another one, or the answer has a horizon.

    Parameters
    ----------
    law : ndarray
        Block of the law.
    words : ndarray of int64
        Sequence answered last; number of answers; number of words up to the sequence; what these words must be, which
        bits of them count, the last one being run_id; the message from its first bytes on.
    sent : ndarray of int64
        The drive after its first bytes.
    answer : ndarray
        Numbers of PiezoDrive: what the law writes.
    """
    head = words[2]
    message = 3 + 2 * head
    for i in range(head):
        if (words[message + i] ^ words[3 + i]) & words[3 + head + i] != 0:
            return False
    stamp, sequence = words[message + 1], words[message + head]
    seconds, nanoseconds = stamp & 0xFFFFFFFF, (stamp >> 32) & 0xFFFFFFFF
    if seconds > 0x7FFFFFFF or nanoseconds >= NANOSECONDS or sequence <= words[0]:
        return False
    words[0] = sequence
    words[1] += 1
    u, drive = record_at(answer, 0, PiezoDrive), record_at(sent, head, Drive)
    # As `Controller.answer` is called.
    time = (seconds * NANOSECONDS + nanoseconds) * 1e-9
    control(time, record_at(words, message + head + 1, Measurement), u, law)
    sent[0], sent[head - 2], sent[head - 1] = stamp, words[message + head - 1], sequence
    for axis in range(3):
        drive.voltage[axis] = u.voltage[axis]
    return bool(u.horizon_count == 0)


class Reply:
    """Answers measurements.

    Parameters
    ----------
    controller : Controller
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        known = measurement_codec().encode(0, 0, 0, np.zeros(size(Measurement)))
        counts = bytearray(len(known))
        frame, numbers = slice(12, 16 + len(FRAME) + 1), 8 * size(Measurement)
        run_id = slice(len(known) - numbers - 16, len(known) - numbers - 8)
        # The kind of encapsulation, frame_id with its length, run_id: not the stamp, and not what is only padding.
        for each in (slice(0, 2), frame, run_id):
            counts[each] = b"\xff" * (each.stop - each.start)
        words = [np.frombuffer(bytes(_ORIGIN) + each, np.int64) for each in (known, counts)]
        head = len(words[0]) - size(Measurement) - 1
        self._words = np.array([-1, 0, head, *words[0][:head], *words[1][:head], *words[0]])
        self._run = 3 + head - 1
        self._noted = memoryview(self._words)  # type: ignore[arg-type]  # an array is a buffer
        self._message = self._noted[3 + 2 * head :].cast("B")[_ORIGIN:]
        self.drive = bytearray(drive_codec().encode(0, 0, 0, np.zeros(3)))
        """The message that answers the last one."""
        self._sent = np.frombuffer(self.drive, np.int64, len(self.drive) // 8 - 1, _ORIGIN)
        self.answer(known)  # compile or load it
        self._words[:2] = -1, 0

    def answer(self, data: bytes) -> bool:
        """Answer a measurement with a sequence above the last one: whether `drive` is the answer now."""
        controller, message = self._controller, self._message
        try:
            message[:] = data
        except ValueError:  # it has another length
            return False
        return not controller.in_python and reply(controller.block, self._words, self._sent, controller.written)

    @property
    def answered(self) -> int:
        """Sequence of the measurement answered last."""
        return int(self._noted[0])

    @property
    def answers(self) -> int:
        """How many were answered."""
        return int(self._noted[1])

    @property
    def run_id(self) -> int:
        """Run of that measurement; 0: there was none."""
        return int(self._noted[self._run]) % 2**64

    def begin(self, run_id: int) -> None:
        """Answer the measurements of this run from here on."""
        self._noted[self._run], self._noted[0] = ctypes.c_int64(run_id).value, -1

    def note(self, sequence: int) -> None:
        """Another way has answered the measurement of this sequence."""
        self._noted[0] = min(sequence, 2**63 - 1)
        self._noted[1] += 1
