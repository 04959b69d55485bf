"""A run whose link has its messages in place is the run over the codecs, bit by bit, whatever comes as an answer."""

import random
import struct
from collections import deque
from typing import Any

import numpy as np
import pytest
from malformed import spoiled
from support import Graph, ros_arguments

from afm_controller_node.node import ControllerNode
from afm_model import Command, SimParameters, build
from afm_model.instrument.wire import Wire
from afm_model.run import Link, Run
from afm_node_common.cdr import measurement_codec
from afm_node_common.drive_codec import drive_codec
from afm_sim_node.node import SimNode

PERIOD, TICKS, SEED, RUN = 2e-6, 400, 20, 1_700_000_000_000_003
MEASUREMENTS, DRIVES = measurement_codec(), drive_codec()


class Bytes(Link):
    """Bytes to and from a test; in place or not."""

    def __init__(self, *, in_place: bool) -> None:
        self.came: deque[bytes] = deque()
        self.sent: list[bytes] = []
        self.reads = 0
        self.wire = Wire(lambda: (self.came.popleft(), None) if self.came else None, self.sent.append)
        if not in_place:
            self._wire, self.wire = self.wire, None

    def publish(self, sequence: int, measurement: Any) -> None:
        data = MEASUREMENTS.encode(RUN, sequence, round(sequence * (PERIOD * 1e9)), measurement)
        if self.wire is not None:
            self.wire.measurement[:] = data
        self.sent.append(data)

    def take(self) -> Any:
        return self.read(self.came.popleft()) if self.came else None

    def read(self, data: bytes) -> Any:
        self.reads += 1
        run_id, sequence, _, drive = DRIVES.decode(data)
        return (sequence if run_id in (0, RUN) else -1), drive


def answers(rng: random.Random, sequence: int, stamp: int, rest: np.ndarray) -> list[bytes]:
    """What comes for a measurement: its answer last, often behind something else."""
    drive = rest + np.array([0.2 * np.sin(0.05 * sequence), 0.001 * (sequence % 7), 0.0])
    good = DRIVES.encode(RUN, sequence, stamp, drive)
    others = [
        DRIVES.encode(RUN - 1, sequence, stamp, drive + 1.0),
        DRIVES.encode(RUN, rng.choice([max(sequence - 1, 0), sequence + 1, 2**63]), stamp, drive + 1.0),
        spoiled(rng, DRIVES.encode(RUN, sequence + 7, stamp, drive + 1.0)),
        rng.randbytes(len(good)),
        good[:4] + struct.pack("<i", -1) + good[8:],
    ]
    kinds = [
        good,
        good,
        DRIVES.encode(0, sequence, stamp, drive),
        DRIVES.encode(RUN, sequence, stamp + 1, drive),
        DRIVES.encode(RUN, sequence, stamp, Command(drive, drive + np.zeros((2, 3)), PERIOD)),
    ]
    return [*rng.sample(others, rng.choice([0, 0, 0, 1, 2])), rng.choice(kinds)]


LOSSES = {"fault.lost.kind": "loss", "fault.lost.signal": "measurement", "fault.lost.size": 0.2, "fault.lost.seed": 5}


@pytest.mark.parametrize("fault", [{}, LOSSES], ids=["whole", "lossy"])
def test_run_in_place_is_the_run_over_codecs_among_whatever_comes(fault: dict[str, Any]) -> None:
    parameters = build(
        SimParameters, {"plant.control_period": PERIOD, "run.duration": TICKS * PERIOD, "score.start": 0.0} | fault
    )
    ends, reads = [], []
    for in_place in (True, False):
        rng, link = random.Random(SEED), Bytes(in_place=in_place)
        run = Run(parameters, link, lambda: 1.0, block_ticks=50)
        rest, seen = run.instrument.drive, 0
        for _ in range(20 * TICKS):
            run.step()
            while seen < len(link.sent):
                _, sequence, stamp, _ = MEASUREMENTS.decode(link.sent[seen])
                seen += 1
                link.came += answers(rng, sequence, stamp, rest)
        snapshot = run.snapshot()
        assert snapshot.ticks == TICKS
        counts = [getattr(snapshot.counts, name) for name in snapshot.counts.__slots__]
        ends.append((run.instrument.trajectory_sha256(), counts, snapshot.unreadable, link.sent))
        reads.append(link.reads)
    assert ends[0] == ends[1]
    assert any(ends[0][1])
    assert reads[0] < 0.7 * reads[1]


def test_what_is_not_the_plain_answer_is_left_alone_and_nothing_is_done() -> None:
    parameters = build(SimParameters, {"plant.control_period": PERIOD})
    link = Bytes(in_place=True)
    run = Run(parameters, link, lambda: 1.0)
    run.step()
    instrument, wire = run.instrument, link.wire
    assert wire is not None
    good, before = DRIVES.encode(RUN, 0, 0, instrument.drive), instrument.numbers("commanded").tobytes()
    for at in (4, 5, 8, 11, 12, 16, 24, 28, 35, 36, 43, 68, 75, 76, 79):  # any byte but those of the drive
        wire.drive[:] = good[:at] + bytes([good[at] ^ 1]) + good[at + 1 :]
        assert instrument.exchange(wire) is None, at
    assert instrument.ticks == 0
    assert instrument.numbers("commanded").tobytes() == before
    wire.drive[:] = good
    assert instrument.exchange(wire) is False
    assert (instrument.ticks, wire.sequence[0]) == (1, 1)
    assert wire.measurement.tobytes() == MEASUREMENTS.encode(RUN, 1, 2000, instrument.measurement)
    assert instrument.exchange(wire) is None  # it comes again


def test_simulator_takes_the_drives_of_our_controller_in_place(monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = {"afm_sim_node:plant.control_period": PERIOD, "afm_sim_node:run.duration": TICKS * PERIOD}
    with Graph(ros_arguments(parameters)) as graph:
        simulator, _ = graph.add(SimNode()), graph.add(ControllerNode())
        read: list[bytes] = []
        monkeypatch.setattr(type(simulator.run.link), "read", lambda _, data: read.append(data))
        graph.spin_until(lambda: simulator.run.snapshot().ticks == TICKS)
    assert not read
