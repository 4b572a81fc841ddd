"""Asks for a price first of all, and again over a new connection; then bills orders, but not for free."""

import contextlib

import rclpy
from geometry_msgs.msg import PointStamped
from nav_msgs.srv import GetPlan
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile


class Client(Node):
    """Blocks in its constructor, as many do."""

    def __init__(self):
        super().__init__("client")
        self.menu = self.create_publisher(
            PointStamped, "/menu", QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        )
        self.menu.publish(self.stamped(3.0))
        self.price = self.asked(1.0) + self.asked(100.0)
        self.bill = self.create_publisher(PointStamped, "/bill", 10)
        self.create_subscription(PointStamped, "/order", self.on_order, 10)

    def stamped(self, x):
        """Return a number with the time."""
        message = PointStamped()
        message.header.stamp = self.get_clock().now().to_msg()
        message.point.x = x
        return message

    def asked(self, x):
        """Return what the clerk tells, by a client that exists for this call only."""
        client = self.create_client(GetPlan, "/price")
        request = GetPlan.Request()
        request.start.pose.position.x = x
        client.wait_for_service()
        future = client.call_async(request)
        rclpy.spin_until_future_complete(self, future)
        self.destroy_client(client)
        return sum(told.pose.position.x for told in future.result().plan.poses)

    def on_order(self, order):
        """Bill what has a price and was ordered at a time."""
        if self.price > 0.0 and order.header.stamp.sec > 0:
            self.bill.publish(self.stamped(order.point.x + self.price))


if __name__ == "__main__":
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Client())
