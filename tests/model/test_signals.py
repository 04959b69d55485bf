"""Claims about the order of the signals."""

import re
from pathlib import Path

from afm_model import signals

MESSAGE = Path(__file__).resolve().parents[2] / "msgs" / "msg" / "Measurement.msg"


def fields() -> list[tuple[str, int]]:
    """Name and count of numbers of each field of the message after its sequence."""
    sizes = {"float64": 1, "geometry_msgs/Vector3": 3}
    lines = re.findall(r"^([\w/]+) (\w+)$", re.sub(r"#.*", "", MESSAGE.read_text()), re.MULTILINE)
    names = [name for _, name in lines]
    return [(name, sizes[kind]) for kind, name in lines[names.index("sequence") + 1 :]]


def test_measurement_has_the_order_of_its_message():
    at = 0
    for name, size in fields():
        assert getattr(signals, name.upper()) == at, name
        at += size
    assert at == signals.MEASUREMENT_SIZE
