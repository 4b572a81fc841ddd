"""A node that passes numbers on, as most nodes do: it hears topics, says on topics, asks or serves; it knows no tester.

When it ends it writes what it did: for each callback and message the monotonic clock [ns], `in` or `out`, where, which.
"""

import argparse
import contextlib
import random
import time
from collections import Counter

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Int64
from std_srvs.srv import SetBool

MARK = 10**9
"""What a sender adds to its numbers, times its mark, so that a receiver can tell who said it."""


class Passer(Node):
    """Says a number once it has heard it so often."""

    def __init__(self, asked):
        super().__init__(asked.name)
        self.asked, self.heard, self.done = asked, Counter(), []
        quality = QoSProfile(depth=100)
        self.says = {topic: self.create_publisher(Int64, topic, quality) for topic in asked.says}
        for topic in asked.hears:
            self.create_subscription(Int64, topic, lambda message, topic=topic: self.on_number(topic, message), quality)
        self.server = self.create_client(SetBool, asked.asks) if asked.asks else None
        if asked.serves:
            self.create_service(SetBool, asked.serves, self.on_ask)

    def note(self, what, where, number):
        """Remember."""
        self.done.append((time.monotonic_ns(), what, where, number))

    def on_number(self, topic, message):
        """Pass on, at once or after a while of up to `jitter`, or ask first."""
        mark, number = divmod(message.data, MARK)
        self.note("in", f"{topic} from {mark}" if mark else topic, number)
        self.heard[number] += 1
        if self.heard[number] < self.asked.times:
            return
        if self.asked.jitter:
            time.sleep(random.uniform(0.0, self.asked.jitter))
        if self.server is None:
            self.say(number)
        else:
            self.note("out", self.asked.asks, number)
            answer = self.server.call_async(SetBool.Request(data=self.asked.flag))
            answer.add_done_callback(lambda done: self.on_answer(number))

    def on_answer(self, number):
        """Say what was asked about."""
        self.note("in", f"{self.asked.asks} answered", number)
        self.say(number)

    def say(self, number):
        """Publish."""
        for topic, publisher in self.says.items():
            self.note("out", topic, number)
            publisher.publish(Int64(data=self.asked.mark * MARK + number))

    def on_ask(self, request, response):
        """Answer."""
        self.note("in", f"{self.asked.serves} {request.data}", -1)
        self.note("out", f"{self.asked.serves} answered", -1)
        response.success = True
        return response


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("name")
    parser.add_argument("log")
    for option in ("--hears", "--says"):
        parser.add_argument(option, nargs="*", default=[])
    for option in ("--asks", "--serves"):
        parser.add_argument(option, default="")
    parser.add_argument("--flag", action="store_true")
    parser.add_argument("--times", type=int, default=1)
    parser.add_argument("--mark", type=int, default=0)
    parser.add_argument("--jitter", type=float, default=0.0)
    rclpy.init()
    node = Passer(parser.parse_args(rclpy.utilities.remove_ros_args()[1:]))
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    with open(f"{node.asked.log}/{node.asked.name}.log", "w") as file:  # noqa: PTH123
        file.writelines(f"{time} {what} {number} {where}\n" for time, what, where, number in node.done)
