"""Control of a run and its safe states over real topics: what is asked by services, and what is told."""

from afm_msgs.msg import ControlTrace, InstrumentStatus, Measurement, PiezoDrive, RecorderStatus, Waveform
from afm_msgs.srv import Step
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from hand_controller import HandController, answer
from std_srvs.srv import Trigger
from support import Graph, Observer, ros_arguments

from afm_model import Instrument, SimParameters, build
from afm_node_common import topics
from afm_sim_node.node import SimNode

TICKS = 60
PARAMETERS: dict[str, object] = {
    "plant.control_period": 1e-4,
    "plant.dt": 1e-6,
    "detector.sample_period": 1e-4,
    "run.duration": TICKS * 1e-4,
    "run.retract_time": 5e-4,
    "score.start": 0.0,
}
CRASH = 2.0
"""z drive above rest [V] that pushes with 58 nN; the sample is held at 0.6 nN."""


def push(measurement: Measurement) -> list[PiezoDrive]:
    return [answer(measurement, 1e-3 * measurement.sequence, 0.0)]


def expected_sha() -> str:
    instrument = Instrument(build(SimParameters, PARAMETERS))  # type: ignore[arg-type]
    rest = instrument.drive
    for k in range(TICKS):
        instrument.tick([1e-3 * k, 0.0, rest[2]])
    return instrument.trajectory_sha256()


class Bench:
    """A simulator in this process, a controller, and somebody who asks."""

    def __init__(self, graph: Graph, law: object = push) -> None:
        self.graph = graph
        self.observer = graph.add(Observer())
        self.controller = graph.add(HandController(law))  # type: ignore[arg-type]
        self.simulator = graph.add(SimNode())
        self.step_client = self.observer.create_client(Step, topics.STEP)
        self.resume_client = self.observer.create_client(Trigger, topics.RESUME)

    @property
    def status(self) -> InstrumentStatus:
        return self.observer.status

    def until(self, state: int) -> InstrumentStatus:
        self.graph.spin_until(lambda: self.status.state == state)
        return self.status

    def step(self, ticks: int) -> Step.Response:
        self.graph.spin_until(self.step_client.service_is_ready)
        return self.graph.result(self.step_client.call_async(Step.Request(ticks=ticks)))

    def resume(self) -> Trigger.Response:
        self.graph.spin_until(self.resume_client.service_is_ready)
        return self.graph.result(self.resume_client.call_async(Trigger.Request()))


def test_any_mix_of_steps_with_pause_play_and_reset_makes_the_same_trajectory() -> None:
    with Graph(ros_arguments(PARAMETERS | {"run.start_paused": True})) as graph:
        bench = Bench(graph)
        for ticks in (1, 7):
            response = bench.step(ticks)
            assert (response.success, response.message) == (True, "")
            # Answered when they are made.
            assert bench.simulator.run.state.name == "PAUSED"
        assert bench.simulator.run.instrument.ticks == 8
        assert bench.observer.call(graph, topics.RESET).success
        # A run that was paused waits, after a reset as well.
        assert bench.step(5).success
        assert bench.step(0).message == "0 ticks are not allowed: it must be 1 at least"
        assert bench.observer.call(graph, topics.PLAY).success
        bench.until(InstrumentStatus.FINISHED)
        assert bench.step(1).message == "the run is finished: it must be paused"
        graph.spin_until(lambda: bench.observer.scores)
        assert bench.observer.scores[-1].trajectory_sha256 == expected_sha()
        # Steps that a reset gives up are answered, too.
        bench.controller.law = lambda measurement: []
        bench.observer.call(graph, topics.RESET)
        bench.observer.call(graph, topics.PAUSE)
        asked = bench.step_client.call_async(Step.Request(ticks=3))
        bench.until(InstrumentStatus.RUNNING)
        bench.observer.call(graph, topics.RESET)
        assert graph.result(asked).message == "not all of the ticks were made: the run is waiting"
        # So are those of a run that waits for its controller.
        graph.remove(bench.controller)
        asked = bench.step_client.call_async(Step.Request(ticks=3))
        graph.spin_until(lambda: bench.simulator.run.stepping)
        bench.observer.call(graph, topics.PAUSE)
        assert not graph.result(asked).success


def test_tip_crash_is_told_on_status_diagnostics_and_score_and_resume_brings_the_tip_back() -> None:
    """In one run: the crash, the way back, a recorder that cannot write, the score."""
    drives = {"z": 0.0, "rest": 0.0}

    def crash(measurement: Measurement) -> list[PiezoDrive]:
        if measurement.sequence == 0:
            drives["rest"] = measurement.drive.z
        return [answer(measurement, 0.0, 0.0, drives["rest"] + drives["z"])]

    values = {
        "run.duration": 1.0,
        "safety.force_limit": 80e-9,  # the tip that comes back rings to 42 nN
        "safety.approach_force": 1e-6,
        "safety.approach_speed": 1e-4,
        "safety.unrecorded": True,
    }
    with Graph(ros_arguments(PARAMETERS | values)) as graph:
        bench = Bench(graph, crash)
        reports: list[DiagnosticArray] = []
        bench.observer.create_subscription(DiagnosticArray, "/diagnostics", reports.append, 10)
        recorder = bench.observer.create_publisher(RecorderStatus, topics.RECORDER_STATUS, topics.LATCHED_QOS)
        # Nobody records: the run is held.
        status = bench.until(InstrumentStatus.HELD)
        assert (status.reason, status.detail) == (
            "not recorded",
            "no recorder receives every stream: the run is held (safety.unrecorded)",
        )
        listeners = [
            bench.observer.create_subscription(topic_type, topic, lambda message: None, topics.STREAM_QOS)
            for topic_type, topic in _streams(bench.simulator)
        ]
        bench.until(InstrumentStatus.RUNNING)
        recorder.publish(RecorderStatus(writing=False, detail="/disk/run.rrd cannot be written: no space left"))
        assert bench.until(InstrumentStatus.HELD).detail.startswith("/disk/run.rrd cannot be written")
        ticks = bench.simulator.run.instrument.ticks
        recorder.publish(RecorderStatus(writing=True))
        bench.until(InstrumentStatus.RUNNING)
        graph.spin_until(lambda: bench.simulator.run.instrument.ticks > ticks)
        assert len(listeners) == len(_streams(bench.simulator))

        drives["z"] = 2.0 * CRASH
        status = bench.until(InstrumentStatus.WITHDRAWN)
        drives["z"] = 0.0
        assert status.reason == "force limit"
        assert status.detail.startswith("the normal force is ")
        assert status.detail.endswith(" N (safety.force_limit = 8e-08 N): the sample is withdrawn")
        graph.spin_until(
            lambda: any(
                entry.level == DiagnosticStatus.ERROR and entry.message == status.detail
                for report in reports
                for entry in report.status
            )
        )
        assert not bench.simulator.run.instrument.in_contact
        # Scanner and tip ring from the way back, and would touch hard.
        graph.spin_until(lambda: bench.status.ticks_withdrawn > 300)
        assert bench.resume().success
        graph.spin_until(lambda: InstrumentStatus.APPROACHING in [each.state for each in bench.observer.statuses])
        bench.until(InstrumentStatus.RUNNING)
        assert bench.resume().message == "the run is running: there is nothing to resume"
        assert (bench.status.reason, bench.status.withdrawals) == ("", 1)
        assert bench.status.ticks_withdrawn > 0


def _streams(simulator: SimNode) -> list[tuple[type, str]]:
    return [(ControlTrace, topics.CONTROL_TRACE)] + [
        (Waveform, channel.name) for channel in simulator.run.instrument.channels
    ]


def test_score_of_a_withdrawn_run_says_so() -> None:
    def crash(measurement: Measurement) -> list[PiezoDrive]:
        return [answer(measurement, 0.0, 0.0, CRASH if measurement.sequence == 20 else None)]

    values = {"safety.force_limit": 40e-9, "safety.resume_after": 2e-3, "safety.approach_speed": 1e-4}
    with Graph(ros_arguments(PARAMETERS | values)) as graph:
        bench = Bench(graph, crash)
        bench.until(InstrumentStatus.FINISHED)
        graph.spin_until(lambda: bench.observer.scores)
        score = bench.observer.scores[-1]
        assert (score.valid, score.withdrawals) == (False, 1)
        away = score.ticks_withdrawn
        assert 20 < away == score.scored_ticks_withdrawn < TICKS - 21
        assert score.reason.startswith(f"the instrument had the drive in {away} of {TICKS} scored ticks (")
        assert "withdrew the sample 1 time, because a limit was passed" in score.reason
        assert str(score.rms.z) == "nan"
