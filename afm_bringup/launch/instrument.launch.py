"""Simulator, controller and recorder as one launch, from a scenario to its score.

ros2 launch afm_bringup instrument.launch.py scenario:=closed_loop_tanh recording:=run.mcap

It ends by itself when the run is finished and the recording closed. A node that dies, or a run that does not come to
its end, ends the whole launch with exit code 1.
"""

import shlex
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import launch.logging
from launch import LaunchContext, LaunchDescription
from launch.action import Action
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    LogInfo,
    OpaqueFunction,
    RegisterEventHandler,
)
from launch.event_handlers import OnProcessExit
from launch.events import matches_action
from launch.events.process import ProcessExited, ShutdownProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.utilities import make_namespace_absolute, prefix_namespace

from afm_bringup.files import executable

_YES, _NO = ("true", "yes", "on", "1"), ("false", "no", "off", "0", "")
_WORDS = dict.fromkeys(_YES, True) | dict.fromkeys(_NO, False)
_PATIENCE = "40"
"""Wall time that all which the command of a controller has started has to end; some of it may ignore a signal [s]."""
_CLOSING = "600"
"""Wall time that the recorder has to complete a long recording [s]."""

_ARGUMENTS = {
    "scenario": ("closed_loop_tanh", "name of a scenario, or a file"),
    "overrides": ("", "parameter file that counts in place of the scenario's parameters"),
    "parts": ("", "parts of your own that the scenario may choose, module:NAME, separated by commas"),
    "namespace": ("", "namespace of the instrument; empty: that of the launch, or afm"),
    "controller": (
        "true",
        "true: ours, in the process that the scenario says; composed: ours, in the simulator's process; false: yours, "
        "started elsewhere; or the command that starts yours (it is given --ros-args --params-file FILE -r "
        "__ns:=NAMESPACE)",
    ),
    "recording": (
        "true",
        "file; true: recording.mcap, in another namespace than afm recording-NAMESPACE.mcap; false: none",
    ),
    "scorecard": (
        "true",
        "file; true: scorecard.json, in another namespace than afm scorecard-NAMESPACE.json; false: only printed",
    ),
    "viewer": ("false", "web: show the growing recording in a browser, and print the link; false: do not"),
}


class Instrument:
    """The processes of one instrument; `actions` starts them, and what ends them.

    Several may be included in one launch, in namespaces of their own: the end of one run leaves the others alone.
    """

    def __init__(self, context: LaunchContext) -> None:
        def value(name: str) -> str:
            return LaunchConfiguration(name).perform(context)

        pushed = context.launch_configurations.get("ros_namespace")
        wanted = value("namespace") or (None if pushed else "afm")
        self._namespace = make_namespace_absolute(prefix_namespace(pushed, wanted))
        self._plain = self._namespace.strip("/").replace("/", "-")
        self._finished = False
        self._processes: dict[str, ExecuteProcess] = {}
        self._scenario = [value("scenario")]
        for option in ("overrides", "parts"):
            self._scenario += [f"--{option}", value(option)] if value(option) else []
        recording = self._file(value("recording"), "recording", ".mcap")
        scorecard = self._file(value("scorecard"), "scorecard", ".json")
        settings = [
            ("afm_sim_node", "run.wait_for_recorder", "true" if recording else "false"),
            ("afm_sim_node", "run.exit_when_finished", "false"),
        ]
        if value("mode"):
            settings.append(("afm_sim_node", "run.mode", value("mode")))
        if recording:
            settings.append(("afm_recorder_node", "path", recording))
        self._parameters = self._check_scenario(settings)
        self._add_loop(value("controller").strip())
        if recording:
            # What is left to write may take a while.
            self._add_node("afm_recorder_node", sigterm_timeout=_CLOSING, sigkill_timeout=_CLOSING)
        if value("viewer") == "web" and recording:
            command = [executable("afm_recorder_node", "live"), recording]
            self._processes["viewer"] = ExecuteProcess(cmd=command, output="screen")
        elif _WORDS.get(value("viewer").lower()) is not False:
            raise RuntimeError(f"viewer:={value('viewer')} is not allowed: it must be false, or web with a recording")
        options = ["--out", scorecard] if scorecard else []
        self._processes["scorecard"] = Node(
            package="afm_bringup",
            executable="scorecard",
            namespace=self._namespace,
            arguments=[*self._scenario, *options, *(["--recorded"] if recording else [])],
            output="screen",
        )

    def actions(self) -> list[Action]:
        """All processes, and what is done when one of them ends."""
        handlers = [
            RegisterEventHandler(OnProcessExit(target_action=process, on_exit=self._ended(name)))
            for name, process in self._processes.items()
        ]
        return [*handlers, *self._processes.values()]

    def _check_scenario(self, settings: list[tuple[str, str, str]]) -> str:
        """Have the scenario checked in the nodes' Python; the parameter file that comes of it and of `settings`."""
        path = Path(launch.logging.launch_config.log_dir) / f"{self._plain}.parameters.yaml"
        more = [word for setting in settings for word in ("--set", *setting)]
        command = [executable("afm_bringup", "check_scenario"), *self._scenario, *more, "--write", str(path)]
        end = subprocess.run([*command, "--say-controller"], capture_output=True, text=True, check=False)
        if end.returncode:
            raise RuntimeError(end.stderr.strip().removeprefix("error: "))
        self._composed = end.stdout.strip() == "composed"
        return str(path)

    def _file(self, value: str, name: str, ending: str) -> str:
        """File that an argument means; empty: none."""
        known = _WORDS.get(value.strip().lower())
        if known is None:
            return value
        own = "" if self._namespace == "/afm" else f"-{self._plain}"
        return f"{name}{own}{ending}" if known else ""

    def _add_loop(self, controller: str) -> None:
        """The simulator, and the controller that is wanted."""
        wanted = _WORDS.get(controller.lower())
        if controller == "composed" or (wanted and self._composed):
            self._add_node("composed", "afm_bringup")
            return
        self._add_node("afm_sim_node")
        if wanted:
            self._add_node("afm_controller_node")
        elif wanted is None:
            command = shlex.split(controller)
            if shutil.which(command[0]) is None:
                raise RuntimeError(
                    f"controller:={controller} is not allowed: it must be true, false, composed, or a command"
                )
            arguments = ["--ros-args", "--params-file", self._parameters, "-r", f"__ns:={self._namespace}"]
            # Launch ends the process that it has started, not what a script has started in turn.
            self._processes["controller"] = ExecuteProcess(
                cmd=[executable("afm_bringup", "contained"), *command, *arguments],
                name="controller",
                output="screen",
                sigkill_timeout=_PATIENCE,
            )

    def _add_node(self, name: str, package: str = "", **options: str) -> None:
        """An executable of ours, in the package of its name unless another is given."""
        self._processes[name] = Node(
            package=package or name,
            executable=name,
            namespace=self._namespace,
            parameters=[self._parameters],
            output="screen",
            **options,
        )

    def _ended(self, name: str) -> Callable[[ProcessExited, LaunchContext], list[Action]]:
        def act(event: ProcessExited, context: LaunchContext) -> list[Action]:
            if context.is_shutdown:
                return []
            if name == "scorecard" and event.returncode == 0:
                # The launch ends when nothing is left of it; other instruments in it go on.
                self._finished = True
                others = [process for key, process in self._processes.items() if key != name]
                return [
                    LogInfo(msg=f"the run on {self._namespace} is finished"),
                    *(EmitEvent(event=ShutdownProcess(process_matcher=matches_action(other))) for other in others),
                ]
            if name == "viewer":
                return [LogInfo(msg="the viewer's server has ended; the run goes on")]
            # How somebody else's controller ends when it is told to is its own affair.
            if self._finished and (name == "controller" or event.returncode == 0):
                return []
            raise RuntimeError(f"{name} on {self._namespace} ended with code {event.returncode}: all are ended")

        return act


def generate_launch_description() -> LaunchDescription:
    """Entry point of `ros2 launch`."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in _ARGUMENTS.items()
    ]
    mode = DeclareLaunchArgument(
        "mode",
        default_value="",
        choices=["", "lockstep", "realtime"],
        description="lockstep or realtime; empty: the scenario's",
    )
    return LaunchDescription([*arguments, mode, OpaqueFunction(function=lambda context: Instrument(context).actions())])
