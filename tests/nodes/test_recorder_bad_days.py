"""Bad days of a recorder, over real topics with processes of their own: nothing that was told is lost, nobody dies."""

import subprocess
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from afm_msgs.msg import ControlTrace, InstrumentStatus, ScanLine, Score, Waveform
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Vector3
from rcl_interfaces.msg import ParameterEvent
from rclpy.qos import qos_profile_parameter_events
from rclpy.serialization import serialize_message
from recorder_bench import BLOCK, NAMESPACE, RecorderProcess
from std_msgs.msg import Header

from afm_node_common import topics
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import IncompleteRecording, RecordingError

ROOM = 64 * 2**20
"""Bytes of the disk that gets full."""


def publish_for(recorder: RecorderProcess, seconds: float, first: int = 0) -> int:
    """Publish blocks as a run does, some 20 a second; tick after the last one."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        recorder.instrument.publish_block(first)
        first += BLOCK
        recorder.instrument.publish_status(InstrumentStatus.RUNNING, first)
        due = time.monotonic() + 0.05
        recorder.spin_until(lambda due=due: time.monotonic() > due)
    return first


def ticks(path: Path) -> int:
    """Ticks in a record, with or without an end."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IncompleteRecording)
        with suppress(RecordingError):  # nothing stands in it yet
            return len(read_recording(path).time_ticks)
        return 0


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A small file system, with room for all that a fast machine publishes in the seconds of a test."""
    folder = tmp_path / "disk"
    folder.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={ROOM}", "tmpfs", str(folder)], capture_output=True, text=True
    )
    if made.returncode:
        pytest.skip(f"no small disk without root: {made.stderr.strip()}")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


def test_a_path_in_use_is_refused_with_one_sentence_and_the_first_recorder_goes_on(tmp_path: Path) -> None:
    # As a launch file does that is included twice: one working directory, the default path, two namespaces.
    with RecorderProcess(Path("recording.mcap"), folder=tmp_path, namespace="lab1") as first:
        first.wait_until_subscribed()
        with RecorderProcess(Path("recording.mcap"), folder=tmp_path, namespace="lab2") as second:
            assert second.process.wait(30) == 2
            (line,) = second.text.splitlines()
            assert "recording.mcap" in line and "another recorder" in line
        for k in range(4):
            first.instrument.publish_block(k * BLOCK)
        first.spin_until(lambda: first.told.ticks == first.told.samples / 2 == 4 * BLOCK)
        first.instrument.end_run(4 * BLOCK)
        assert first.end() == 0, first.text
    assert len(read_recording(tmp_path / "recording.mcap").time_ticks) == 4 * BLOCK
    assert [file.name for file in tmp_path.iterdir()] == ["recording.mcap"]


def test_what_was_told_a_second_before_a_kill_is_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with RecorderProcess(path) as recorder:
        recorder.wait_until_subscribed()
        published = publish_for(recorder, 0.1)
        recorder.spin_until(lambda: recorder.told.ticks > 0)
        published = publish_for(recorder, 2.0, published)
        recorder.kill()
        killed = time.monotonic()
    told = max(status.ticks for at, status in recorder.history if at < killed - 1.0)
    assert told > 0
    with pytest.warns(IncompleteRecording, match="it has no end"):
        recording = read_recording(path)
    assert not recording.complete
    assert told <= len(recording.time_ticks) <= published
    assert len(recording.time_samples) >= 2 * told
    assert recording.parameters["afm_sim_node"]


@pytest.mark.long
def test_recorders_that_follow_dead_ones_keep_what_each_had_written(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    names = ("run.mcap", "run-2.mcap", "run-3.mcap")
    for name, blocks in zip(names, (1, 2, 3), strict=True):
        with RecorderProcess(path) as recorder:
            recorder.wait_until_subscribed()
            for k in range(blocks):
                recorder.instrument.publish_block(k * BLOCK)
            recorder.spin_until(lambda blocks=blocks: recorder.told.ticks == blocks * BLOCK)
            assert recorder.told.path == str(tmp_path / name)

            def flushed(name: str = name, blocks: int = blocks) -> bool:
                return ticks(tmp_path / name) == blocks * BLOCK

            recorder.spin_until(flushed)
            if blocks == 3:
                recorder.instrument.end_run(blocks * BLOCK)
                assert recorder.end() == 0
            else:
                recorder.kill()
        if blocks > 1:
            assert f"this run is recorded in {tmp_path / name}" in recorder.text
    assert [ticks(tmp_path / name) for name in names] == [BLOCK, 2 * BLOCK, 3 * BLOCK]
    assert read_recording(tmp_path / names[-1]).complete
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(names)


def test_full_disk_is_told_and_writing_resumes_with_the_gap_as_an_event(small_disk: Path) -> None:
    path, ballast = small_disk / "run.mcap", small_disk / "ballast"
    # So that it need not wait long for what does not fit into memory.
    with RecorderProcess(path, first="from afm_recorder_node import recorder; recorder._WAITING = 50_000") as recorder:
        recorder.wait_until_subscribed()
        first = publish_for(recorder, 0.5)
        recorder.spin_until(lambda: recorder.told.ticks == first)
        with ballast.open("wb", buffering=0) as file:
            try:
                while file.write(b"\0" * 4096):
                    pass
            except OSError:
                pass

        def told() -> bool:
            nonlocal first
            first = publish_for(recorder, 0.05, first)
            return not recorder.told.writing

        recorder.spin_until(told)
        # The next flush fails, half a second later at most; status and diagnostics follow at once.
        assert "No space left on device" in recorder.told.detail
        reports = recorder.diagnostics
        recorder.spin_until(lambda: reports and reports[-1].level == DiagnosticStatus.ERROR)
        assert "No space left on device" in reports[-1].message

        def full() -> bool:
            nonlocal first
            first = publish_for(recorder, 0.05, first)
            return recorder.told.ticks_unwritten > 0

        recorder.spin_until(full)
        ballast.unlink()
        recorder.spin_until(lambda: recorder.told.writing)
        first = publish_for(recorder, 0.3, first)
        recorder.spin_until(lambda: recorder.told.ticks == first)
        # Samples come on other topics, so that another block may be the first that is missing.
        recorder.spin_until(lambda: recorder.told.samples == 2 * first)
        missing, samples = recorder.told.ticks_unwritten, recorder.told.samples_unwritten
        recorder.instrument.end_run(first, rms=Vector3(x=1e-9, y=2e-9, z=3e-9))
        assert recorder.end() == 0, recorder.text
    with pytest.warns(IncompleteRecording, match="could not be written"):
        recording = read_recording(path)
    assert len(recording.time_ticks) == first - missing
    assert any(text.startswith(f"{missing} ticks and {samples} samples") for _, text in recording.events)
    assert recording.score is not None and recording.score["rms"] == {"x": 1e-9, "y": 2e-9, "z": 3e-9}
    assert "can be written again" in recorder.text


def trace(count: int = 2, **fields: object) -> ControlTrace:
    return ControlTrace(
        **{
            "control_period": 2e-6,
            "position": [0.0] * 3 * count,
            "velocity": [0.0] * 3 * count,
            "reference_position": [0.0] * 3 * count,
            "deflection": [0.0] * count,
            "drive": [0.0] * 3 * count,
            "round_trip": [0.0] * count,
        }
        | fields
    )


def wave(**fields: object) -> Waveform:
    return Waveform(**{"sample_period": 1e-6, "scale": 1.0, "unit": "m", "samples": [0.0, 1.0]} | fields)


def at(message: object, seconds: int, nanoseconds: int = 0) -> object:
    message.header.stamp.sec, message.header.stamp.nanosec = seconds, nanoseconds
    return message


SENSELESS = {
    "a control trace of length 2": (topics.CONTROL_TRACE, trace(position=[0.0, 0.0])),
    "no ticks": (topics.CONTROL_TRACE, trace(0)),
    "lengths that do not agree": (topics.CONTROL_TRACE, trace(round_trip=[0.0] * 5)),
    "period NaN": (topics.CONTROL_TRACE, trace(control_period=float("nan"))),
    "period 0": (topics.CONTROL_TRACE, trace(control_period=0.0)),
    "period below 0": (topics.DEFLECTION, wave(sample_period=-1e-6)),
    "period infinite": (topics.DEFLECTION, wave(sample_period=float("inf"))),
    "first 2^63": (topics.DEFLECTION, wave(first_sample=2**63)),
    "first 2^64 - 1": (topics.CONTROL_TRACE, trace(first_sequence=2**64 - 1)),
    "a number that is not its time's": (topics.DEFLECTION, wave(first_sample=10**6)),
    "stamp below 0": (topics.CONTROL_TRACE, at(trace(), -1)),
    "nanoseconds of 4 s": (topics.DEFLECTION, at(wave(), 0, 4_000_000_000)),
    "scale NaN": (topics.DEFLECTION, wave(scale=float("nan"))),
    "another unit": (topics.DEFLECTION, wave(unit="N")),
    "no run": (topics.DEFLECTION, wave(run_id=0)),
    "a state of no run": (topics.STATUS, InstrumentStatus(run_id=0)),
    "a line without channels": (topics.SCAN_LINE, ScanLine()),
    "a state before the start": (topics.STATUS, at(InstrumentStatus(), -5)),
    "a score before the start": (topics.SCORE, at(Score(), -5)),
}


def test_messages_that_make_no_sense_are_dropped_counted_and_named(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with RecorderProcess(path) as recorder:
        recorder.wait_until_subscribed()
        publishers = {
            topics.CONTROL_TRACE: recorder.instrument.trace,
            topics.DEFLECTION: recorder.instrument.waveforms[topics.DEFLECTION],
            topics.STATUS: recorder.instrument.status,
            topics.SCAN_LINE: recorder.instrument.lines,
            topics.SCORE: recorder.instrument.score,
        }
        recorder.instrument.publish_block(0)
        dropped = 0
        for what, (topic, message) in SENSELESS.items():
            message.run_id = 0 if "no run" in what else recorder.instrument.run_id
            publishers[topic].publish(message)
            dropped += 1
            recorder.spin_until(lambda dropped=dropped: recorder.told.messages_dropped == dropped)
            assert f"/{NAMESPACE}/{topic} from /{NAMESPACE}/afm_sim_node was dropped" in recorder.told.detail, what
        recorder.instrument.publish_block(BLOCK)
        recorder.spin_until(lambda: recorder.told.ticks == 2 * BLOCK and recorder.told.samples == 4 * BLOCK)
        assert (recorder.told.ticks_lost, recorder.told.samples_lost) == (0, 0)
        recorder.instrument.end_run(2 * BLOCK)
        assert recorder.end() == 0, recorder.text
    assert len(read_recording(path).time_ticks) == 2 * BLOCK
    assert "was dropped" in recorder.text


def test_bytes_that_are_no_message_are_dropped_and_end_nobody(tmp_path: Path) -> None:
    path, rng = tmp_path / "run.mcap", np.random.default_rng(0)
    with RecorderProcess(path) as recorder:
        recorder.wait_until_subscribed()
        instrument = recorder.instrument
        events = instrument.create_publisher(ParameterEvent, "/parameter_events", qos_profile_parameter_events)
        recorder.spin_until(lambda: events.get_subscription_count() > 0)
        instrument.publish_block(0)
        whole = serialize_message(trace(run_id=instrument.run_id))
        texts = {
            instrument.status: InstrumentStatus(detail="x" * 8),
            instrument.trace: trace(header=Header(frame_id="x" * 8)),
            instrument.waveforms[topics.DEFLECTION]: wave(header=Header(frame_id="x" * 8)),
        }
        sent = [bytes.fromhex("0001"), b"\0", whole[:7], whole[:-3], whole[:60]]
        sent += [rng.bytes(int(size)) for size in rng.integers(1, 400, 100)]
        # Lengths that say 32 GB, and other words that say something else: any may still be a message. Not those of the
        # run: a block of another run is recorded.
        run = whole.index(instrument.run_id.to_bytes(8, "little"))
        words = [k for k in range(4, len(whole), 4) if k not in (run, run + 4)]
        sent += [whole[:k] + b"\xff\xff\xff\xff" + whole[k + 4 :] for k in words]
        for data in sent:
            for publisher in (instrument.trace, instrument.waveforms[topics.DEFLECTION], events):
                publisher.publish(data)
            recorder.spin_until(lambda: True)
        for publisher, message in texts.items():
            message.run_id = instrument.run_id
            publisher.publish(serialize_message(message).replace(b"x" * 8, b"\xff" * 8))
        instrument.publish_block(BLOCK)
        recorder.spin_until(lambda: recorder.told.ticks == 2 * BLOCK and recorder.told.samples == 4 * BLOCK)
        # A few of the random ones may be read as something, and something else is the matter with them then.
        assert recorder.told.messages_dropped >= 100
        instrument.end_run(2 * BLOCK)
        assert recorder.end() == 0, recorder.text
    assert len(read_recording(path).time_ticks) == 2 * BLOCK


def test_folder_deleted_while_recording_is_made_again_and_nothing_is_lost(tmp_path: Path) -> None:
    path = tmp_path / "out" / "run.mcap"
    with RecorderProcess(path) as recorder:
        recorder.wait_until_subscribed()
        first = publish_for(recorder, 0.7)
        path.unlink()
        path.parent.rmdir()
        recorder.spin_until(path.exists)
        first = publish_for(recorder, 0.3, first)
        recorder.instrument.end_run(first)
        recorder.spin_until(lambda: recorder.told.ticks == first)
        assert recorder.end() == 0, recorder.text
    assert len(read_recording(path).time_ticks) == first
    assert "was removed while it was written" in recorder.text


CLOCK = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

/* The clock of the system, a minute early as soon as a file is there. */
int clock_gettime(clockid_t clock, struct timespec *time) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(clock, time);
    if (clock == CLOCK_REALTIME && !access(getenv("CLOCK_STEPPED"), F_OK)) time->tv_sec -= 60;
    return result;
}
"""


def test_clock_that_is_set_back_by_a_minute_loses_nothing(tmp_path: Path) -> None:
    source, library, stepped = tmp_path / "clock.c", tmp_path / "clock.so", tmp_path / "stepped"
    source.write_text(CLOCK)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    path = tmp_path / "run.mcap"
    environment = {"LD_PRELOAD": str(library), "CLOCK_STEPPED": str(stepped)}
    with RecorderProcess(path, **environment) as recorder:
        recorder.wait_until_subscribed()
        first = publish_for(recorder, 0.3)
        recorder.spin_until(lambda: recorder.told.ticks == first)
        stepped.touch()
        first = publish_for(recorder, 1.0, first)
        # The status goes on, and what was told is in the file although nobody has asked for an end.
        recorder.spin_until(lambda: recorder.told.ticks == first)

        def flushed() -> bool:
            return ticks(path) == first

        recorder.spin_until(flushed)
        recorder.instrument.end_run(first)
        assert recorder.end() == 0, recorder.text
    assert len(read_recording(path).time_ticks) == first


def test_waveform_of_any_name_in_the_namespace_is_recorded_under_it(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with RecorderProcess(path) as recorder:
        recorder.wait_until_subscribed()
        recorder.instrument.publish_block(0)
        creep = recorder.instrument.create_publisher(Waveform, "truth/creep_x", topics.STREAM_QOS)
        elsewhere = recorder.instrument.create_publisher(Waveform, "/elsewhere/creep_x", topics.STREAM_QOS)
        recorder.spin_until(lambda: creep.get_subscription_count() > 0)
        for k in range(3):
            message = wave(first_sample=4 * k, sample_period=1e-3, samples=[1.0 * k] * 4, scale=2e-9)
            recorder.instrument.publish(creep, message, 2_000 * k)
        recorder.instrument.publish_block(BLOCK)
        recorder.spin_until(lambda: recorder.told.ticks == 2 * BLOCK and recorder.told.samples == 4 * BLOCK)
        assert elsewhere.get_subscription_count() == 0
        assert creep.wait_for_all_acked()
        recorder.instrument.end_run(2 * BLOCK)
        assert recorder.end() == 0, recorder.text
    recording = read_recording(path)
    channel = recording.channels["truth/creep_x"]
    np.testing.assert_allclose(channel.values, np.repeat([0.0, 2e-9, 4e-9], 4), rtol=1e-15)
    assert np.array_equal(channel.time, np.arange(12) / 1e3)
    assert (channel.unit, channel.scale) == ("m", 2e-9)
    assert np.array_equal(recording.channels["deflection"].values, recording.deflection)
    assert len(recording.time_samples) == 4 * BLOCK
