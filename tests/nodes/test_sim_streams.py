"""The recording streams: every sample and every tick of a run, once, in SI units."""

import numpy as np
import pytest
from afm_msgs.msg import ControlTrace, InstrumentStatus, Measurement, Waveform
from geometry_msgs.msg import Vector3
from hand_controller import HandController, answer
from support import Graph, Observer, ros_arguments

from afm_node_common import topics
from afm_sim_node.node import SimNode

CONTROL_PERIOD, SAMPLE_PERIOD = 6e-6, 2e-6
SAMPLES_PER_TICK = 3
TICKS = 1234  # not a whole number of blocks
CHANNELS = {
    topics.DEFLECTION: ("m", 10e-9),
    topics.LATERAL_FORCE: ("N", 40e-9),
    topics.TRUTH_LATERAL_FORCE_Y: ("N", 1.0),
    topics.TRUTH_NORMAL_FORCE: ("N", 1.0),
}


def nanoseconds(message: Waveform | ControlTrace | Measurement) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def vectors(values: list[Vector3]) -> np.ndarray:
    return np.array([[value.x, value.y, value.z] for value in values])


class Listener(Observer):
    """A recorder that keeps everything."""

    def __init__(self) -> None:
        super().__init__("listener")
        self.waveforms: dict[str, list[Waveform]] = {topic: [] for topic in CHANNELS}
        self.traces: list[ControlTrace] = []
        for topic, blocks in self.waveforms.items():
            self.create_subscription(Waveform, topic, blocks.append, topics.STREAM_QOS)
        self.create_subscription(ControlTrace, topics.CONTROL_TRACE, self.traces.append, topics.STREAM_QOS)

    def samples(self, topic: str) -> np.ndarray:
        return np.concatenate([block.samples for block in self.waveforms[topic]])

    def trace(self, name: str) -> np.ndarray:
        return np.concatenate([getattr(trace, name) for trace in self.traces])

    @property
    def complete(self) -> bool:
        # Topics do not arrive in step: the last of each may come after the score.
        ticks = sum(len(trace.deflection) for trace in self.traces)
        counts = {sum(len(block.samples) for block in blocks) for blocks in self.waveforms.values()}
        return bool(self.scores) and ticks == TICKS and counts == {TICKS * SAMPLES_PER_TICK}


@pytest.fixture(scope="module")
def run() -> tuple[Listener, HandController]:
    """A run whose blocks are cut by a pause in the middle, with noise, an ADC and a DAC."""
    parameters = {
        "plant.control_period": CONTROL_PERIOD,
        "detector.sample_period": SAMPLE_PERIOD,
        "detector.lateral_sensitivity": CHANNELS[topics.LATERAL_FORCE][1],
        "detector.noise": 1e-3,
        "detector.adc_bits": 16,
        "piezo.dac_bits": 14,
        "piezo.limit": 0.5,
        "run.duration": TICKS * CONTROL_PERIOD,
        "run.start_paused": True,
    }
    with Graph(ros_arguments(parameters)) as graph:
        # The drive leaves the range of the piezo now and then.
        controller = graph.add(HandController(lambda m: [answer(m, 0.6 * np.sin(0.01 * m.sequence), 0.1234567)]))
        listener = graph.add(Listener())
        graph.add(SimNode())
        graph.spin_until(lambda: listener.status.recorders == 1)
        listener.call(graph, topics.PLAY)
        graph.spin_until(lambda: len(controller.seen) > 100)
        listener.call(graph, topics.PAUSE)
        graph.spin_until(lambda: listener.traces)
        listener.call(graph, topics.PLAY)
        graph.spin_until(lambda: listener.complete)
    return listener, controller


def test_blocks_join_without_a_gap_and_hold_every_sample(run: tuple[Listener, HandController]) -> None:
    listener, _ = run
    for topic, (unit, scale) in CHANNELS.items():
        at = 0
        for block in listener.waveforms[topic]:
            assert (block.first_sample, block.sample_period) == (at, SAMPLE_PERIOD)
            assert (block.unit, block.scale, block.header.frame_id) == (unit, scale, topics.FRAME)
            assert nanoseconds(block) == round(at * SAMPLE_PERIOD * 1e9)
            assert len(block.samples) > 0
            at += len(block.samples)
        assert at == TICKS * SAMPLES_PER_TICK
        assert len({len(block.samples) for block in listener.waveforms[topic]}) > 1, "the pause should have cut a block"


def test_control_trace_joins_without_a_gap_and_holds_every_tick(run: tuple[Listener, HandController]) -> None:
    listener, _ = run
    at = 0
    for trace in listener.traces:
        assert (trace.first_sequence, trace.control_period) == (at, CONTROL_PERIOD)
        assert nanoseconds(trace) == round(at * CONTROL_PERIOD * 1e9)
        count = len(trace.deflection)
        assert len(trace.round_trip) == count
        for name in ("position", "velocity", "reference_position", "drive"):
            assert len(getattr(trace, name)) == 3 * count
        at += count
    assert at == TICKS
    assert np.all(listener.trace("round_trip") > 0.0)


def test_waveforms_and_trace_hold_what_the_controller_was_told(run: tuple[Listener, HandController]) -> None:
    listener, controller = run
    seen = controller.seen
    assert [measurement.sequence for measurement in seen] == list(range(TICKS))
    for topic, voltage, value in (
        (topics.DEFLECTION, "deflection_voltage", "deflection"),
        (topics.LATERAL_FORCE, "lateral_voltage", "lateral_force"),
    ):
        # The first sample of a tick is the one in its measurement.
        samples = listener.samples(topic)[::SAMPLES_PER_TICK]
        assert np.array_equal(samples, [getattr(measurement, voltage) for measurement in seen])
        told = np.array([getattr(measurement, value) for measurement in seen])
        assert np.array_equal(samples * CHANNELS[topic][1], told)
    for name in ("position", "velocity", "reference_position"):
        told = vectors([getattr(measurement, name) for measurement in seen])
        assert np.array_equal(listener.trace(name).reshape(-1, 3), told)
    assert np.array_equal(listener.trace("deflection"), [measurement.deflection for measurement in seen])
    for measurement in seen:
        assert nanoseconds(measurement) == round(measurement.sequence * CONTROL_PERIOD * 1e9)
        assert measurement.header.frame_id == topics.FRAME


def test_trace_holds_the_drive_after_range_and_resolution(run: tuple[Listener, HandController]) -> None:
    listener, controller = run
    drive = listener.trace("drive").reshape(-1, 3)
    step = 2.0 * 0.5 / 2**14
    assert np.array_equal(drive, step * np.round(drive / step))
    asked = 0.6 * np.sin(0.01 * np.arange(TICKS))
    assert np.abs(asked).max() > 0.5
    # Half a step of rounding; the top of the range is one step below the limit.
    assert np.abs(drive[:, 0] - np.clip(asked, -0.5, 0.5 - step)).max() <= 0.5 * step * (1.0 + 1e-9)
    # Each measurement tells the drive applied until then: that of the tick before.
    told = vectors([measurement.drive for measurement in controller.seen])
    assert np.array_equal(told[1:], drive[:-1])


def test_samples_between_two_ticks_are_samples_of_their_own(run: tuple[Listener, HandController]) -> None:
    listener, _ = run
    samples = listener.samples(topics.DEFLECTION).reshape(-1, SAMPLES_PER_TICK)
    # With noise of 1 mV and steps of 0.3 mV a repeated value is rare.
    assert np.mean(samples[:, 1] == samples[:, 0]) < 0.3
    assert np.mean(samples[:, 2] == samples[:, 1]) < 0.3


def test_simulator_told_so_waits_for_a_recorder() -> None:
    parameters = {
        "run.duration": 100 * CONTROL_PERIOD,
        "plant.control_period": CONTROL_PERIOD,
        "run.wait_for_recorder": True,
    }
    with Graph(ros_arguments(parameters)) as graph:
        observer = graph.add(Observer())
        controller = graph.add(HandController(lambda m: [answer(m, 0.0, 0.0)]))
        graph.add(SimNode())
        # Several reports later it still waits.
        graph.spin_until(lambda: len(observer.statuses) > 3)
        assert observer.status.state == InstrumentStatus.WAITING
        assert controller.seen == []
        listener = graph.add(Listener())
        graph.spin_until(lambda: observer.scores and sum(len(trace.deflection) for trace in listener.traces) == 100)
