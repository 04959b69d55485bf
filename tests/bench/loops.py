"""The closed loop of the paper over topics, as users run it: nodes as processes, scored by the simulator itself."""

import os
import time
from pathlib import Path
from typing import Any

import rclpy
import yaml
from afm_msgs.msg import InstrumentStatus, Percentiles, Score
from machine import cpu_seconds, executable, resident_megabytes, running
from rclpy.node import Node

from afm_node_common import topics

_TIMEOUT = 600.0


class Run:
    """One run of simulator and controller, without a session around them.

    Parameters
    ----------
    folder : Path
        For parameter file, log and recording.
    composed : bool
        Both in one process.
    recorded : bool
        With a recorder as a process of its own.
    parameters : dict
        Of the simulator, over those of the scenario closed_loop_tanh.
    process : dict
        Scheduling of both.
    """

    def __init__(
        self,
        folder: Path,
        *,
        composed: bool,
        recorded: bool = False,
        parameters: dict[str, Any],
        process: dict[str, Any] | None = None,
    ) -> None:
        self._folder, self._composed, self._recorded = folder, composed, recorded
        wishes = {f"process.{name}": value for name, value in (process or {}).items()}
        simulator = {"reference.z_r": 1e-13, "run.wait_for_recorder": recorded, **parameters, **wishes}
        controller = {"law.kind": "tanh", "law.alpha": 10.0, **wishes}
        self._file = folder / "bench.yaml"
        self._file.write_text(
            yaml.safe_dump(
                {
                    "/**/afm_sim_node": {"ros__parameters": simulator},
                    "/**/afm_controller_node": {"ros__parameters": controller},
                }
            )
        )
        self.recorder: dict[str, float] = {}
        self.resident: dict[str, float] = {}
        self.cpu_s: list[float] = []
        """Processor time of the simulator's process when the run was first told to run, and at its end [s]."""

    def _commands(self) -> list[list[str]]:
        arguments = ["--ros-args", "--params-file", str(self._file)]
        commands = (
            [[executable("afm_bringup", "composed"), *arguments]]
            if self._composed
            else [[executable(name, name), *arguments] for name in ("afm_sim_node", "afm_controller_node")]
        )
        if self._recorded:
            recording = self._folder / "bench.rrd"
            name = "afm_recorder_node"
            commands.append([executable(name, name), "--ros-args", "-p", f"path:={recording}"])
        return commands

    def score(self) -> Score:
        """Run to the end; the score."""
        rclpy.init()
        try:
            node = Node("bench")
            scores: list[Score] = []
            topic = f"/{topics.NAMESPACE}/{topics.SCORE}"
            node.create_subscription(Score, topic, scores.append, topics.LATCHED_QOS)

            def heard(status: InstrumentStatus) -> None:
                if status.state == InstrumentStatus.RUNNING and not self.cpu_s:
                    self.cpu_s.append(cpu_seconds(processes[0].pid))

            node.create_subscription(
                InstrumentStatus, f"/{topics.NAMESPACE}/{topics.STATUS}", heard, topics.LATCHED_QOS
            )
            with running(*self._commands(), log=self._folder / "bench.log") as processes:
                limit = time.monotonic() + _TIMEOUT
                while not scores:
                    if time.monotonic() > limit or any(process.poll() is not None for process in processes):
                        raise RuntimeError(f"a run did not end: see {self._folder / 'bench.log'}")
                    rclpy.spin_once(node, timeout_sec=0.2)
                self.cpu_s.append(cpu_seconds(processes[0].pid))
                names = ["composed"] if self._composed else ["simulator", "controller"]
                for name, process in zip([*names, "recorder"], processes, strict=False):
                    self.resident[name] = resident_megabytes(process.pid)
                if self._recorded:
                    self.recorder = {"cpu_s": cpu_seconds(processes[-1].pid)}
            node.destroy_node()
            return scores[0]
        finally:
            rclpy.shutdown()


def percentiles(times: Percentiles) -> list[float]:
    """Median, percentiles and largest [s]."""
    return [getattr(times, name) for name in times.get_fields_and_field_types()]


def lockstep(
    folder: Path, control_period: float, ticks: int, *, composed: bool, recorded: bool = False
) -> dict[str, Any]:
    """Ticks a second and real-time factor of a lockstep run."""
    parameters = {"plant.control_period": control_period, "run.duration": ticks * control_period}
    run = Run(folder, composed=composed, recorded=recorded, parameters=parameters)
    score = run.score()
    return {
        "control_period_s": control_period,
        "ticks": ticks,
        "ticks_per_second": ticks / score.wall,
        "real_time_factor": score.simulated / score.wall,
        "round_trip_s": percentiles(score.round_trip),
        "trajectory_sha256": score.trajectory_sha256,
        "cpu_s_per_tick": (run.cpu_s[-1] - run.cpu_s[0]) / ticks,
        "resident_mb": run.resident,
        **run.recorder,
    }


def domain() -> None:
    """A ROS domain away from the user's own nodes."""
    os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
