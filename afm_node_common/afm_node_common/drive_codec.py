"""PiezoDrive between a drive of the model, with or without a horizon, and the bytes on the wire.

A drive without a horizon, which every ordinary controller sends, has the fixed layout of `Codec`: the horizon's period
and its length, both zero, follow the voltages.
"""

import struct
from typing import Any

import numpy as np
from afm_msgs.msg import PiezoDrive
from geometry_msgs.msg import Vector3
from numpy.typing import NDArray
from rclpy.serialization import serialize_message

from afm_model import Command, DriveError
from afm_model.parts.signals import LONGEST_HORIZON

from .cdr import LITTLE_ENDIAN_CDR, Codec, fill, is_text
from .decoding import NANOSECONDS

Drive = NDArray[np.float64] | Command | DriveError
"""Voltages (3,) [V]; with a horizon a Command; for a horizon that is not allowed, the error."""
_NO_HORIZON = bytes(12)
_PERIOD_AND_COUNT = struct.Struct("<dI4x")  # the drives after them are aligned to 8
_VOLTAGE, _DRIVE = 24, 24  # bytes


class DriveCodec(Codec):
    """Encoder and decoder of PiezoDrive. What `encode` takes and `decode` gives in place of an array: see `Drive`.

    Parameters
    ----------
    fast : bool
        As of `Codec`.
    """

    def __init__(self, *, fast: bool = True) -> None:
        super().__init__(PiezoDrive, 3, tail=_NO_HORIZON, fast=fast)

    def _encode_other(self, run_id: int, sequence: int, stamp_ns: int, values: Any) -> bytes:
        if not isinstance(values, Command):
            return super()._encode_other(run_id, sequence, stamp_ns, values)
        if not len(values.horizon):
            return self.encode(run_id, sequence, stamp_ns, values.voltage)
        if self.fast:
            head = self.encode(run_id, sequence, stamp_ns, values.voltage)[: -len(_NO_HORIZON)]
            return head + _PERIOD_AND_COUNT.pack(values.horizon_period, len(values.horizon)) + values.horizon.tobytes()
        message = PiezoDrive()
        fill(message, run_id, sequence, stamp_ns, values.voltage)
        message.horizon_period = float(values.horizon_period)
        message.horizon = [Vector3(x=x, y=y, z=z) for x, y, z in values.horizon.tolist()]
        return bytes(serialize_message(message))

    def _decode_other(self, data: bytes) -> tuple[int, int, int, Any]:
        return self._decode_horizon(data) or super()._decode_other(data)

    def _decode_horizon(self, data: bytes) -> tuple[int, int, int, Drive] | None:
        """A message with a horizon that is laid out as we write it; None: it is not."""
        layout = self._layouts.get(int.from_bytes(data[12:16], "little"))
        if not self.fast or data[:2] != LITTLE_ENDIAN_CDR or layout is None:
            return None
        voltage = layout.head.size
        behind = voltage + _VOLTAGE + _PERIOD_AND_COUNT.size
        if len(data) < behind + _DRIVE:
            return None
        _, seconds, nanoseconds, frame, run_id, sequence = layout.head.unpack_from(data)
        period, count = _PERIOD_AND_COUNT.unpack_from(data, voltage + _VOLTAGE)
        if (
            count > LONGEST_HORIZON
            or len(data) != behind + count * _DRIVE
            or not is_text(frame[4:])
            or seconds < 0
            or nanoseconds >= NANOSECONDS
        ):
            return None
        numbers = np.frombuffer(data, np.float64, 3, voltage)
        horizon = np.frombuffer(data, np.float64, 3 * count, behind).reshape(count, 3)
        return run_id, sequence, seconds * NANOSECONDS + nanoseconds, _command(numbers, horizon, period)

    def _read(self, message: Any) -> Drive:
        if not message.horizon:
            return super()._read(message)
        voltage = message.voltage
        horizon = np.array([(drive.x, drive.y, drive.z) for drive in message.horizon])
        return _command(np.array([voltage.x, voltage.y, voltage.z]), horizon, message.horizon_period)


def _command(voltage: NDArray[np.float64], horizon: NDArray[np.float64], period: float) -> Drive:
    try:
        return Command(voltage, horizon, period)
    except DriveError as error:
        return error


def drive_codec(*, fast: bool = True) -> DriveCodec:
    """Codec of PiezoDrive."""
    return DriveCodec(fast=fast)
