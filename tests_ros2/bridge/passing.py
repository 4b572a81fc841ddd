"""Passes on what it hears: from one topic to another, or, given two domains, from one of them to the other."""

import contextlib
import sys

import rclpy
from geometry_msgs.msg import PointStamped
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

heard, said, *rest = rclpy.utilities.remove_ros_args(sys.argv)[1:]
numbers = [int(word) for word in rest if word.isdigit()] or [None]
quality = QoSProfile(depth=10)
if "hasty" in rest:
    quality.reliability = ReliabilityPolicy.BEST_EFFORT

contexts = [rclpy.Context() for _ in numbers]
nodes = []
for context, domain in zip(contexts, numbers, strict=True):
    rclpy.init(context=context, domain_id=domain, args=sys.argv, signal_handler_options=SignalHandlerOptions.ALL)
    nodes.append(Node("passing", context=context))
publisher = nodes[-1].create_publisher(PointStamped, said, quality)
nodes[0].create_subscription(PointStamped, heard, publisher.publish, quality)
with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
    executor = SingleThreadedExecutor(context=contexts[0])
    executor.add_node(nodes[0])
    executor.spin()
