"""Run by test_verbs: asks for a scan of many lines, and waits for its end."""

import rclpy
from afm_msgs.action import Scan
from rclpy.action import ActionClient
from rclpy.node import Node

rclpy.init()
node = Node("mortal", namespace="afm")
client = ActionClient(node, Scan, "scan")
client.wait_for_server()
goal = client.send_goal_async(Scan.Goal(size_x=40e-9, size_y=10e-9, pixels=8, lines=8000, line_rate=20.0))
rclpy.spin_until_future_complete(node, goal)
rclpy.spin_until_future_complete(node, goal.result().get_result_async())
