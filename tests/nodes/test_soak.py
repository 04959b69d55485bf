"""What a session and a recording use stays what it was. The long form is `make soak`."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from soak.judgement import COUNTS, Use, judge
from soak.report import grown, uses
from soak.run import endless, soak
from soak.sampling import Sample, sample
from soak.verbs import soak_verbs
from support import assert_nothing_left

from afm_node_common.heap import give_back
from afm_recorder_node.reader import read_recording

SAMPLE = Sample(at=0.0, memory=1e8, shared=1e6, descriptors=20, threads=10, segments=5, processor=0.0)


@pytest.mark.long
def test_session_uses_no_more_after_ten_thousands_of_messages_than_before(tmp_path: Path) -> None:
    """In lockstep, as fast as it goes: what grew with each message or tick would be seen in seconds."""
    out = tmp_path / "out"
    scenario = endless("closed_loop_tanh", tmp_path / "scenario.yaml")
    samples = soak(scenario, out, seconds=4.0, warm_up=2.0, every=0.25, told=print, ticks=10_000)
    assert set(samples) == {"session", "cleanup", "afm_sim_node", "afm_controller_node", "afm_recorder_node"}
    found = uses(samples)
    problems = grown({name: {key: use for key, use in of.items() if key != "memory"} for name, of in found.items()})
    assert problems == []
    # That of the recorder follows the rows that wait, and the loop's must not follow anything.
    assert grown({name: {"memory": found[name]["memory"]} for name in ("afm_sim_node", "afm_controller_node")}) == []
    assert read_recording(out / "recording.mcap").complete
    assert_nothing_left()


@pytest.mark.long
def test_processes_use_no_more_after_many_verbs_and_recordings_than_before(tmp_path: Path) -> None:
    samples, recordings = soak_verbs(tmp_path / "out", seconds=0.0, warm_up=3.0, told=print, rounds=7)
    assert recordings >= 7
    found = {name: {key: use for key, use in of.items() if key in COUNTS} for name, of in uses(samples).items()}
    # Threads of a pool that rerun starts and ends are no growth.
    assert grown({name: {**of, "threads": steady(of["threads"], 4)} for name, of in found.items()}) == []
    assert_nothing_left()


def steady(use: Use, spread: float) -> Use:
    """As judged, if it may come and go by so much."""
    return replace(use, flat=use.end <= use.begin + spread)


WRITER = """
import os, sys
from pathlib import Path
import recorded
from recorded import Run
from soak.sampling import sample

runs = Run(100)
writer = recorded.begin(Path(sys.argv[1]), runs.messages())
for flush in range(int(sys.argv[2])):
    if flush == int(sys.argv[2]) // 10:
        before = sample(os.getpid()).memory
    recorded.put(writer, runs.block(0, 20))
print(sample(os.getpid()).memory - before)
"""
FLUSHES = 1500
"""Those of ten minutes. The index of the chunks, which stands at the end of a record, takes some 400 bytes each."""


def test_writer_of_a_record_keeps_nothing_of_what_it_has_written_but_its_index(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WRITER, str(tmp_path / "run.mcap"), str(FLUSHES)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120, env=environment)
    assert float(done.stdout) < 2e6


def test_memory_that_is_free_below_a_piece_in_use_is_given_back() -> None:
    # Larger than what Python keeps in pools of its own, smaller than what the allocator maps apart.
    pieces = [bytes(1000) for _ in range(100_000)]
    full = sample(os.getpid()).memory
    used = pieces[::1000]
    del pieces
    give_back()
    assert full - sample(os.getpid()).memory > 50e6
    assert len(used) == 100


@pytest.mark.parametrize("quantity", ["memory", "shared", "descriptors", "threads", "segments"])
def test_growth_is_told_and_a_single_moment_is_none(quantity: str) -> None:
    unit = 1e5 if quantity in ("memory", "shared") else 0.2
    steady = [replace(SAMPLE, at=60.0 * k) for k in range(30)]
    growing = [replace(one, **{quantity: getattr(one, quantity) + k * 2.0 * unit}) for k, one in enumerate(steady)]
    assert judge(steady, quantity).flat
    assert not judge(growing, quantity).flat
    moment = [*steady[:-1], replace(steady[-1], **{quantity: 10.0 * getattr(SAMPLE, quantity)})]
    assert judge(moment, quantity).flat
    stepped = [replace(one, **{quantity: getattr(one, quantity) + 20.0 * unit}) for one in steady[15:]]
    assert judge([*steady[:15], *stepped], quantity).flat == (quantity in ("memory", "shared"))
    (sentence,) = grown(uses({"node": growing}))
    assert sentence.startswith(f"{quantity} of node went from ")
