"""Sends a driver where orders say, and tells how the errand ended.

Feedback and result are messages of two topics: a node that was held up finds both, and rclpy hands it the result first.
"""

import contextlib

import rclpy
from geometry_msgs.msg import PointStamped
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class Dispatcher(Node):
    """Has one errand at a time."""

    def __init__(self):
        super().__init__("dispatcher")
        self.client = ActionClient(self, NavigateToPose, "/errand")
        self.left, self.status, self.errand, self.is_off = None, None, None, False
        self.done = self.create_publisher(PointStamped, "/done", 10)
        self.create_subscription(PointStamped, "/order", self.on_order, 10)
        self.create_subscription(PointStamped, "/stop", self.on_stop, 10)
        self.client.wait_for_server()

    def on_order(self, message):
        """Send the driver there."""
        self.left, self.status, self.errand, self.is_off = None, None, None, False
        goal = NavigateToPose.Goal()
        goal.pose.pose.position.x = message.point.x
        self.client.send_goal_async(goal, self.on_feedback).add_done_callback(self.on_answer)

    def on_feedback(self, message):
        """Note how far it is."""
        self.left = message.feedback.distance_remaining
        self.tell()

    def on_answer(self, future):
        """Wait for the end."""
        self.errand = future.result()
        if self.errand.accepted:
            self.errand.get_result_async().add_done_callback(self.on_result)
        if self.is_off:
            self.errand.cancel_goal_async()

    def on_stop(self, message):
        """Call the driver back, now or as soon as it has answered."""
        self.is_off = True
        if self.errand is not None:
            self.errand.cancel_goal_async()

    def on_result(self, future):
        """Note how it ended."""
        self.status = float(future.result().status)
        self.tell()

    def tell(self):
        """Say how it ended, and how far it was at last, once both are known."""
        if self.left is None or self.status is None:
            return
        message = PointStamped()
        message.header.stamp = self.get_clock().now().to_msg()
        message.point.x, message.point.y = self.status, self.left
        self.done.publish(message)


rclpy.init()
with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(Dispatcher())
