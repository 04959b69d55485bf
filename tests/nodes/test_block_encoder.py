"""Long messages are written as rclpy's own serializer writes them."""

import functools

import numpy as np
import pytest
from afm_msgs.msg import ControlTrace, InstrumentStatus, Waveform
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message

from afm_node_common import topics
from afm_node_common.cdr import BlockEncoder

encoder = functools.cache(BlockEncoder)
numbers = st.floats(width=64)
counts = st.integers(0, 2**64 - 1)
stamps = st.integers(0, 2**31 * 10**9 - 1)
texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20)
STRATEGIES = {
    "uint64": counts,
    "double": numbers,
    "string": texts,
    "sequence<double>": st.lists(numbers, max_size=20),
    "sequence<float>": st.lists(st.floats(width=32), max_size=20),
}


@pytest.mark.parametrize("kind", [Waveform, ControlTrace])
@given(data=st.data(), stamp=stamps)
def test_rclpy_reads_what_the_encoder_writes(kind: type, data: st.DataObject, stamp: int) -> None:
    _, *fields = kind.get_fields_and_field_types().items()
    values = {name: data.draw(STRATEGIES[field]) for name, field in fields}
    assert encoder(kind).fast
    message = deserialize_message(encoder(kind).encode(stamp, **values), kind)
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp
    assert message.header.frame_id == topics.FRAME
    for name, value in values.items():
        read = getattr(message, name)
        assert read == value if isinstance(value, str) else np.array_equal(read, value, equal_nan=True)


@pytest.mark.parametrize("kind", [Waveform, ControlTrace])
@given(data=st.data(), stamp=stamps)
def test_fast_and_slow_encoder_give_the_same_message(kind: type, data: st.DataObject, stamp: int) -> None:
    _, *fields = kind.get_fields_and_field_types().items()
    values = {name: data.draw(STRATEGIES[field]) for name, field in fields}
    fast, slow = (encoder(kind, fast=fast).encode(stamp, **values) for fast in (True, False))
    read = [repr(deserialize_message(written, kind)) for written in (fast, slow)]
    assert read[0] == read[1]


def test_message_of_another_kind_is_left_to_rclpy() -> None:
    assert not encoder(InstrumentStatus).fast
