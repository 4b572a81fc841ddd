"""Serves errands: says how far it is, and is there when somebody says so, or gives up when called back."""

import contextlib

import rclpy
from geometry_msgs.msg import PointStamped
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionServer, CancelResponse
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future


class Driver(Node):
    """A goal's coroutine waits for what ends it."""

    def __init__(self):
        super().__init__("driver")
        self.end = Future()
        self.create_subscription(PointStamped, "/arrived", lambda message: self.end.set_result("there"), 10)
        ActionServer(self, NavigateToPose, "/errand", self.execute, cancel_callback=self.on_cancel)

    def on_cancel(self, goal):
        """Turn round."""
        self.end.set_result("called back")
        return CancelResponse.ACCEPT

    async def execute(self, goal):
        """Drive until it is over."""
        self.end = Future()
        left = NavigateToPose.Feedback(distance_remaining=goal.request.pose.pose.position.x)
        left.current_pose.header.stamp = self.get_clock().now().to_msg()
        goal.publish_feedback(left)
        if await self.end == "there":
            goal.succeed()
        else:
            goal.canceled()
        return NavigateToPose.Result()


rclpy.init()
with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(Driver())
