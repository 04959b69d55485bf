"""Claims about the order of the signals."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from afm_model import ScoreSummary, signals
from afm_model.instrument.score import COUNTS, RANGES, VECTORS, columns

MESSAGES = Path(__file__).resolve().parents[2] / "msgs" / "msg"


def fields(message: str, after: str) -> list[tuple[str, str]]:
    """Name and type of each field of a message that stands after another one."""
    lines = re.findall(r"^([\w/\[\]]+) (\w+)$", re.sub(r"#.*", "", (MESSAGES / message).read_text()), re.MULTILINE)
    names = [name for _, name in lines]
    return [(name, kind) for kind, name in lines[names.index(after) + 1 :]]


def shape(dtype: np.dtype[Any], name: str) -> tuple[int, ...]:
    """How many numbers a field of a record is."""
    kind: np.dtype[Any] = (dtype.fields or {})[name][0]
    assert kind.base == np.float64
    return kind.shape


@pytest.mark.parametrize(
    ("message", "record"), [("Measurement.msg", signals.MEASUREMENT), ("PiezoDrive.msg", signals.DRIVE)]
)
def test_record_has_the_order_of_its_message(message, record):
    shapes = {"float64": (), "geometry_msgs/Vector3": (3,)}
    expected = [(name, shapes[kind]) for name, kind in fields(message, "sequence")]
    assert [(name, shape(record, name)) for name in record.names] == expected
    # Nothing between them: the record is the bytes of the message.
    assert record.itemsize == 8 * sum(3 if shape else 1 for _, shape in expected)


def test_score_has_the_names_and_the_order_of_its_message():
    kinds = {name: "uint64" for name in COUNTS} | {name: "float64[3]" for name in VECTORS}
    kinds |= {name: "float64[2]" for name in RANGES}
    ours = [(name, kinds.get(name, "float64")) for name in ScoreSummary.__dataclass_fields__]
    told = [field for field in fields("Score.msg", "start") if field[0] in ScoreSummary.__dataclass_fields__]
    assert told == ours
    assert len(columns()) == len(ours) + 2 * len(VECTORS) + len(RANGES)
