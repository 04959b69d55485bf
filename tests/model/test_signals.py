"""Claims about the order of the signals."""

import re
from pathlib import Path

import numpy as np
import pytest

from afm_model import ScoreSummary
from afm_model.compiled.records import Record, size
from afm_model.instrument.score import COUNTS, RANGES, VECTORS, columns
from afm_model.parts import signals

MESSAGES = Path(__file__).resolve().parents[2] / "msgs" / "msg"


def fields(message: str, after: str) -> list[tuple[str, str]]:
    """Name and type of each field of a message that stands after another one."""
    lines = re.findall(r"^(\S+) (\w+)$", re.sub(r"#.*", "", (MESSAGES / message).read_text()), re.MULTILINE)
    names = [name for _, name in lines]
    return [(name, kind) for kind, name in lines[names.index(after) + 1 :]]


def described(record: type[Record], name: str) -> tuple[type, tuple[int, ...]]:
    """Type and number of the numbers of a field of a record."""
    return record.fields[name][:2]


@pytest.mark.parametrize(
    ("message", "record"), [("Measurement.msg", signals.Measurement), ("PiezoDrive.msg", signals.PiezoDrive)]
)
def test_record_has_the_order_of_its_message(message, record):
    kinds = {
        "float64": (np.float64, ()),
        "int64": (np.int64, ()),
        "geometry_msgs/Vector3": (np.float64, (3,)),
        f"geometry_msgs/Vector3[<={signals.LONGEST_HORIZON}]": (np.float64, (signals.LONGEST_HORIZON, 3)),
    }
    expected = [(name, kinds[kind]) for name, kind in fields(message, "sequence")]
    # A message says how long its horizon is by itself.
    names = [name for name in record.names if name not in ("sequence", "horizon_count")]
    assert [(name, described(record, name)) for name in names] == expected


def test_record_of_a_measurement_is_the_bytes_of_the_message_behind_its_sequence():
    numbers = sum(int(np.prod(described(signals.Measurement, name)[1])) for name in signals.Measurement.names)
    assert size(signals.Measurement) == numbers


def test_score_has_the_names_and_the_order_of_its_message():
    kinds = {name: "uint64" for name in COUNTS} | {name: "geometry_msgs/Vector3" for name in VECTORS}
    ours = list(ScoreSummary.__dataclass_fields__)
    parts = {name: [f"{name}_min", f"{name}_max"] if name in RANGES else [name] for name in ours}
    expected = [(part, kinds.get(name, "float64")) for name in ours for part in parts[name]]
    known = {name for name, _ in expected}
    assert [field for field in fields("Score.msg", "start") if field[0] in known] == expected
    assert len(columns()) == len(ours) + 2 * len(VECTORS) + len(RANGES)
