"""Simulator, controller and recorder as one launch, from a scenario.

ros2 launch afm_bringup instrument.launch.py scenario:=closed_loop_tanh recording:=recording.rrd
Arguments: scenario (name or file), recording (empty: do not record), controller (false: bring your own),
mode (lockstep or realtime).
"""

from launch import LaunchContext, LaunchDescription
from launch.action import Action
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from afm_bringup.files import find_scenario


def _nodes(context: LaunchContext) -> list[Action]:
    """The nodes, once the arguments are known."""

    def value(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    scenario = str(find_scenario(value("scenario")))
    sim: dict[str, str | bool] = {"run.wait_for_recorder": bool(value("recording"))}
    if value("mode"):
        sim["run.mode"] = value("mode")
    nodes = [
        Node(
            package="afm_sim_node",
            executable="afm_sim_node",
            output="screen",
            parameters=[scenario, sim],
        )
    ]
    if value("controller").lower() == "true":
        nodes.append(
            Node(
                package="afm_controller_node",
                executable="afm_controller_node",
                output="screen",
                parameters=[scenario],
            )
        )
    if value("recording"):
        nodes.append(
            Node(
                package="afm_recorder_node",
                executable="afm_recorder_node",
                output="screen",
                parameters=[scenario, {"path": value("recording")}],
            )
        )
    return nodes


def generate_launch_description() -> LaunchDescription:
    """Entry point of `ros2 launch`."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("scenario", default_value="closed_loop_tanh", description="name or file"),
            DeclareLaunchArgument("recording", default_value="recording.rrd", description="file; empty: none"),
            DeclareLaunchArgument("controller", default_value="true", description="false: bring your own"),
            DeclareLaunchArgument("mode", default_value="", description="lockstep or realtime; empty: the scenario's"),
            OpaqueFunction(function=_nodes),
        ]
    )
