"""Plain numbers for plots, and what is told on /diagnostics about QoS and by the controller."""

import numpy as np
import pytest
from afm_msgs.msg import ControlTrace, InstrumentStatus, Measurement, PiezoDrive, Telemetry
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from hand_controller import HandController, answer
from rclpy.qos import qos_profile_sensor_data
from support import Graph, Observer, ros_arguments

from afm_controller_node.node import ControllerNode
from afm_node_common import topics
from afm_sim_node.node import SimNode

PERIOD = 1e-3
REALTIME = {
    "plant.control_period": PERIOD,
    "detector.sample_period": 1e-4,
    "run.mode": "realtime",
    "run.real_time_factor": 0.2,
    "run.watchdog_timeout": 1000.0,
}


def gentle(measurement: Measurement) -> list[PiezoDrive]:
    return [answer(measurement, 1e-3 * (measurement.sequence % 5), 0.0)]


def test_telemetry_is_the_run_at_some_of_its_ticks_in_plain_numbers() -> None:
    with Graph(ros_arguments(REALTIME | {"run.duration": 200 * PERIOD})) as graph:
        observer = graph.add(Observer())
        told: list[Telemetry] = []
        traces: list[ControlTrace] = []
        observer.create_subscription(Telemetry, topics.TELEMETRY, told.append, qos_profile_sensor_data)
        observer.create_subscription(ControlTrace, topics.CONTROL_TRACE, traces.append, topics.STREAM_QOS)
        controller = graph.add(HandController(gentle))
        simulator = graph.add(SimNode())
        graph.spin_until(lambda: observer.scores)
        graph.spin_until(lambda: sum(len(trace.deflection) for trace in traces) == 200)
        measured = {measurement.sequence: measurement for measurement in controller.seen}
        reference = np.concatenate([trace.reference_position for trace in traces]).reshape(-1, 3)
        position = np.concatenate([trace.position for trace in traces]).reshape(-1, 3)
        deflection = np.concatenate([trace.deflection for trace in traces])
        running = [message for message in told if 0 < message.sequence < 200]
        # Plain float64 fields only: every tool shows them without a word.
        assert set(list(Telemetry.get_fields_and_field_types().values())[3:]) == {"double"}
        assert len(running) > 3
        assert len({message.sequence for message in running}) == len(running)
        height = simulator.run.instrument.parameters.cantilever.a
        for message in running:
            k = message.sequence
            assert [message.error_x, message.error_y] == (reference[k] - position[k])[:2].tolist()
            assert message.error_z == reference[k][2] - height - deflection[k]
            assert message.deflection == deflection[k]
            assert message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec == pytest.approx(k * PERIOD, abs=1e-9)
            assert message.normal_force != 0.0
            assert message.real_time_factor > 0.0
            if k in measured:
                drive = measured[k].drive
                assert [message.drive_x, message.drive_y, message.drive_z] == [drive.x, drive.y, drive.z]
                assert message.lateral_force == measured[k].lateral_force
        # Decimated: no more than 50 a second of wall time.
        assert len(running) <= 1 + 51 * observer.scores[0].wall


def test_telemetry_can_be_switched_off() -> None:
    with Graph(ros_arguments(REALTIME | {"run.duration": 100 * PERIOD, "run.telemetry_rate": 0.0})) as graph:
        observer = graph.add(Observer())
        told: list[Telemetry] = []
        observer.create_subscription(Telemetry, topics.TELEMETRY, told.append, topics.CONTROL_QOS)
        graph.add(HandController(gentle))
        graph.add(SimNode())
        graph.spin_until(lambda: observer.scores)
        assert told == []


def test_mismatch_of_qos_is_a_warning_in_diagnostics_before_and_during_a_run() -> None:
    sentence = "/afm/best_effort publishes piezo_drive best effort: it must be reliable"
    with Graph(ros_arguments(REALTIME)) as graph:
        observer, deaf = graph.add(Observer()), graph.add(Observer("best_effort"))
        reports: list[DiagnosticArray] = []
        observer.create_subscription(DiagnosticArray, "/diagnostics", reports.append, 10)
        deaf.create_publisher(PiezoDrive, topics.PIEZO_DRIVE, qos_profile_sensor_data)
        graph.add(SimNode())

        def told() -> bool:
            return bool(reports) and sentence in reports[-1].status[0].message

        graph.spin_until(told)
        assert reports[-1].status[0].level == DiagnosticStatus.WARN
        assert observer.status.state == InstrumentStatus.WAITING
        graph.add(HandController(gentle))
        graph.spin_until(lambda: observer.status.state == InstrumentStatus.RUNNING)
        reports.clear()
        graph.spin_until(told)
        assert reports[-1].status[0].level == DiagnosticStatus.WARN
        graph.spin_until(lambda: sentence in observer.status.warning)


def test_controller_tells_on_diagnostics_what_it_does_and_what_it_cannot_read() -> None:
    with Graph() as graph:
        observer = graph.add(Observer())
        reports: list[DiagnosticStatus] = []
        observer.create_subscription(DiagnosticArray, "/diagnostics", lambda array: reports.extend(array.status), 10)
        publisher = observer.create_publisher(Measurement, topics.MEASUREMENT, topics.CONTROL_QOS)
        graph.add(ControllerNode())
        graph.spin_until(lambda: publisher.get_subscription_count() and reports)
        entry = reports[-1]
        assert (entry.level, entry.message) == (DiagnosticStatus.OK, "waiting for measurements")
        assert entry.name == "/afm/afm_controller_node: controller"
        publisher.publish(Measurement(sequence=0))
        graph.spin_until(lambda: reports[-1].message == "answering")
        assert {each.key: each.value for each in reports[-1].values} == {
            "law": "tanh",
            "measurements answered": "1",
            "messages dropped": "0",
        }
        publisher.publish(bytes.fromhex("0001"))
        graph.spin_until(lambda: reports[-1].level == DiagnosticStatus.WARN)
        assert "a message on /afm/measurement from /afm/observer was dropped: 2 bytes" in reports[-1].message
        graph.spin_until(lambda: reports[-1].level == DiagnosticStatus.OK)
