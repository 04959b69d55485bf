"""Messages are sorted by the run that they name, whatever order they come in, and each record holds its run once."""

import logging
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recorded
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import CONTROL_PERIOD, Topic

from afm_model.microscope.verbs import Scan
from afm_node_common.decoding import nanoseconds
from afm_recorder_node import heads, runs
from afm_recorder_node.definitions import definition, kind_of, serialized
from afm_recorder_node.heads import MessageHead
from afm_recorder_node.names import CHANNELS
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recorder import Message, Recorder
from afm_recorder_node.recording import IncompleteRecording, Recording
from afm_recorder_node.runs import LineCounts, RunProgress, StreamCounts

BLOCK, BLOCKS = 10, 3


def message_of(topic: Topic) -> Message:
    name, message = topic
    time_ns = nanoseconds(message.header.stamp)
    return Message(name, kind_of(message), time_ns, time_ns, serialized(message))


def recorder_at(path: Path, **options: Any) -> Recorder:
    def event(run_id: int, time_ns: int, text: str) -> Message:
        name, message = recorded.event(time_ns / 1e9, text)
        message.run_id = run_id
        return message_of((name, message))

    given = {"trace": "control_trace", "channels": list(CHANNELS), "about": {"namespace": "/afm"}, "event": event}
    return Recorder(path, logging.getLogger("recorder"), definition, **given | options)


def put(recorder: Recorder, topic: Topic) -> RunProgress | None:
    """Give a message to a recorder as its node does; of a block nothing comes back."""
    message = message_of(topic)
    if topic[0] == "control_trace":
        return recorder.block(message, heads.control_trace(message.data))
    if topic[0] in CHANNELS:
        return recorder.block(message, heads.waveform(message.data))
    return recorder.put(message, topic[1].run_id)


def run_of(run_id: int, ticks: int = BLOCK * BLOCKS) -> dict[str, list[Topic]]:
    """All that a run publishes, by topic, in the order of each."""
    scan = Scan(pixels=4, lines=2 + run_id, channels="height, lateral")
    found: dict[str, list[Topic]] = {"scan_line": [recorded.line_message(line) for line in recorded.lines_of(scan)]}
    found["events"] = [recorded.event(k * CONTROL_PERIOD, f"event {k} of {run_id}") for k in range(3)]
    for name, message in recorded.Run(ticks, seed=run_id).messages(BLOCK):
        found.setdefault(name, []).append((name, message))
    for each in [each for messages in found.values() for each in messages]:
        each[1].run_id = run_id
    return found


def read(path: Path) -> Recording:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IncompleteRecording)  # no run has come to an end
        return read_recording(path)


RUNS = {run_id: run_of(run_id) for run_id in (1, 2, 3)}


@st.composite
def deliveries(draw: st.DrawFn) -> list[Topic]:
    """All messages of the runs: each topic of a run keeps its order; any message may come again at any time."""
    queues = [list(messages) for run in RUNS.values() for messages in run.values()]
    rng = draw(st.randoms(use_true_random=False))
    lag = draw(st.booleans())  # runs follow one another, with some messages late; or all are mixed
    come = list[Topic]()
    while queues:
        queue = queues[min(rng.randrange(len(queues)), rng.randrange(len(queues)) if lag else len(queues))]
        come.append(queue.pop(0))
        if rng.random() < 0.2:
            come.append(rng.choice(come))
        queues = [each for each in queues if each]
    return come


@settings(max_examples=15)
@given(come=deliveries())
def test_each_record_holds_exactly_its_run_whatever_comes_late_or_twice(
    tmp_path_factory: pytest.TempPathFactory, come: list[Topic]
) -> None:
    folder = tmp_path_factory.mktemp("runs")
    recorder = recorder_at(folder / "run.mcap")
    for topic in come:
        put(recorder, topic)
        recorder.update()
    recorder.close()
    found = {}
    for path in folder.iterdir():
        recording = read(path)
        (text, *_) = (text for _, text in recording.events)
        found[int(text.split()[-1])] = recording
    assert found.keys() == RUNS.keys()
    for run_id, recording in found.items():
        run = recorded.Run(BLOCK * BLOCKS, seed=run_id)
        assert np.array_equal(recording.position, run.position) and np.array_equal(recording.drive, run.drive)
        assert np.array_equal(recording.normal_force, run.samples[3])
        assert recording.events == [(k * CONTROL_PERIOD, f"event {k} of {run_id}") for k in range(3)]
        (image,) = recording.images
        assert image.scan.lines == 2 + run_id
        assert not any(np.isnan(values).any() for values in image.data.values())


@pytest.fixture
def recorder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Recorder]:
    monkeypatch.setattr("afm_recorder_node.recorder._FLUSH_PERIOD", 0.0)
    monkeypatch.setattr(runs, "QUIET", 0.0)
    recorder = recorder_at(tmp_path / "run.mcap")
    yield recorder
    recorder.close()


def end(recorder: Recorder, run_id: int, ticks: int = BLOCK * BLOCKS) -> None:
    """What the node learns from the last status of a run."""
    progress = put(recorder, ("status", _with(recorded.status(1.0, 1)[1], run_id)))
    assert progress is not None
    progress.over, progress.ticks, progress.samples = True, ticks, 2 * ticks


def _with(message: Any, run_id: int) -> Any:
    message.run_id = run_id
    return message


def test_record_is_closed_when_its_run_is_over_and_whole_and_what_comes_later_is_left_out(
    recorder: Recorder, tmp_path: Path
) -> None:
    for messages in RUNS[1].values():
        for topic in messages:
            put(recorder, topic)
    recorder.update()
    with pytest.warns(IncompleteRecording):
        assert not read_recording(tmp_path / "run.mcap").complete  # it may go on
    end(recorder, 1)
    recorder.update()
    whole = (tmp_path / "run.mcap").read_bytes()
    assert read_recording(tmp_path / "run.mcap").complete
    for messages in RUNS[1].values():
        for topic in messages:
            assert put(recorder, topic) is None
    recorder.update()
    assert [file.name for file in tmp_path.iterdir()] == ["run.mcap"]
    assert (tmp_path / "run.mcap").read_bytes() == whole
    assert recorder.counts().ticks == BLOCK * BLOCKS  # that of the run is still shown


def test_run_that_is_over_is_waited_for_as_long_as_a_block_is_missing(
    recorder: Recorder, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for messages in RUNS[1].values():
        for topic in messages[:-1]:
            put(recorder, topic)
    end(recorder, 1)
    recorder.update()
    assert recorder.waits()
    monkeypatch.setattr(runs, "SILENCE", 0.0)
    recorder.update()
    assert not recorder.waits()
    with pytest.warns(IncompleteRecording, match="the last 10 ticks and 20 samples a channel are missing"):
        assert len(read_recording(tmp_path / "run.mcap").time_ticks) == BLOCK * (BLOCKS - 1)


@pytest.mark.parametrize("silent", ["control_trace", *list(CHANNELS)[::3]])
def test_stream_that_brings_nothing_while_others_do_is_a_problem(recorder: Recorder, silent: str) -> None:
    blocks = run_of(4, BLOCK * (runs._LAG + 2))
    for number in range(runs._LAG + 1):
        for name in ("control_trace", *CHANNELS):
            if name != silent:
                put(recorder, blocks[name][number])
    assert f"nothing comes on {silent} " in recorder.present.problem
    put(recorder, blocks[silent][0])
    assert not recorder.present.problem


def test_event_that_comes_before_the_first_block_stands_in_front_of_it(recorder: Recorder, tmp_path: Path) -> None:
    for name in ("events", "scan_line", "parameters", "control_trace"):
        for topic in RUNS[2][name]:
            put(recorder, topic)
    recorder.close()
    recording = read(tmp_path / "run.mcap")
    assert recording.events[0] == (0.0, "event 0 of 2")
    assert recording.images[0].scan.lines == 4


def test_messages_without_a_block_leave_no_file(recorder: Recorder, tmp_path: Path) -> None:
    for name in ("events", "scan_line", "parameters"):
        for topic in RUNS[1][name]:
            put(recorder, topic)
    recorder.update()
    recorder.close()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("taken", ["run-2.mcap", "run-2.rrd"])
def test_next_run_takes_the_next_name_that_is_free(
    recorder: Recorder, tmp_path: Path, taken: str, caplog: pytest.LogCaptureFixture
) -> None:
    put(recorder, RUNS[1]["control_trace"][0])
    (tmp_path / taken).write_text("another one's")
    put(recorder, RUNS[2]["control_trace"][0])
    assert recorder.counts().path == str(tmp_path / "run-3.mcap")
    assert f"never replaced: this run is recorded in {tmp_path / 'run-3.mcap'}" in caplog.text
    recorder.close()
    assert (tmp_path / taken).read_text() == "another one's"
    assert {len(read(tmp_path / name).time_ticks) for name in ("run.mcap", "run-3.mcap")} == {BLOCK}


def test_values_between_blocks_are_counted_as_lost_and_a_late_start_is_not() -> None:
    stream = StreamCounts()
    assert all(stream.put(MessageHead(0, 1, first, 10)) for first in (50, 60, 90))
    assert not stream.put(MessageHead(0, 1, 60, 10))
    assert (stream.begin, stream.next, stream.received, stream.lost) == (50, 100, 30, 20)


def test_lines_between_others_of_a_scan_are_counted_as_lost() -> None:
    lines = LineCounts()
    for scan, place in ((1, 0), (1, 1), (1, 4), (2, 1)):
        lines.put(scan, place)
    assert (lines.received, lines.lost) == (4, 3)


def test_what_is_missing_of_a_run_is_named() -> None:
    progress = RunProgress(1, "control_trace", ["deflection"])
    assert progress.missing() == ["it has not come to an end: the simulator or the recorder was ended during the run"]
    progress.over, progress.ticks, progress.samples = True, 100, 200
    progress.stream("control_trace").put(MessageHead(0, 1, 0, 100))
    progress.stream("deflection").put(MessageHead(0, 1, 0, 200))
    assert progress.missing() == []
    progress.stream("control_trace").begin = 20
    progress.stream("deflection").unwritten = 7
    progress.lines.put(1, 2)
    assert progress.missing() == [
        "it begins at tick 20, sample 0: the instrument ran before the recorder",
        "2 lines of scans (trace and retrace counted each) are missing",
        "0 ticks and 7 samples a channel could not be written",
    ]
