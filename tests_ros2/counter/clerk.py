"""Adds its fee, a parameter of its own, to what it is asked; repeats what stands on the menu."""

import contextlib

import rclpy
from geometry_msgs.msg import PointStamped, PoseStamped
from nav_msgs.srv import GetPlan
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Clerk(Node):
    """Serves."""

    def __init__(self):
        super().__init__("clerk")
        self.fee = self.declare_parameter("fee", 0.0).value
        self.posted = self.create_publisher(PointStamped, "/posted", LATCHED)
        self.create_subscription(PointStamped, "/menu", self.posted.publish, LATCHED)
        self.create_service(GetPlan, "/price", self.on_ask)

    def on_ask(self, request, response):
        """Answer."""
        told = PoseStamped()
        told.pose.position.x = request.start.pose.position.x + self.fee
        response.plan.poses.append(told)
        return response


if __name__ == "__main__":
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Clerk())
