#!/usr/bin/env python3
"""Serves /plan (nav_msgs/GetPlan): a path from start to goal that bends around the obstacle that is most in the way.

It knows obstacles from /obstacles (geometry_msgs/PoseArray); each is a disc of radius obstacle_radius [m].
"""

import contextlib
import math

import rclpy
from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.srv import GetPlan
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class Avoider(Node):
    """Keeps the obstacles, and answers."""

    def __init__(self):
        super().__init__("avoider")
        radius = (
            self.declare_parameter("obstacle_radius", 0.2).value + self.declare_parameter("robot_radius", 0.2).value
        )
        self.room = radius + self.declare_parameter("margin", 0.15).value
        self.obstacles = []
        self.create_subscription(PoseArray, "/obstacles", self.on_obstacles, 1)
        self.create_service(GetPlan, "/plan", self.on_plan)

    def on_obstacles(self, obstacles):
        """Take up where obstacles are."""
        self.obstacles = [(pose.position.x, pose.position.y) for pose in obstacles.poses]

    def on_plan(self, request, response):
        """Answer with a path of two or three corners."""
        start, goal = request.start.pose.position, request.goal.pose.position
        response.plan.header.stamp = self.get_clock().now().to_msg()
        response.plan.header.frame_id = request.goal.header.frame_id or "map"
        for x, y in [(start.x, start.y), *self.way_round(start, goal), (goal.x, goal.y)]:
            pose = PoseStamped(header=response.plan.header)
            pose.pose.position.x, pose.pose.position.y = x, y
            pose.pose.orientation.w = 1.0
            response.plan.poses.append(pose)
        return response

    def way_round(self, start, goal):
        """Return no point, or the one beside the obstacle that leaves the least room on the straight line."""
        dx, dy = goal.x - start.x, goal.y - start.y
        length = math.hypot(dx, dy)
        if length < 1e-6:
            return []
        ux, uy = dx / length, dy / length
        worst = None
        for x, y in self.obstacles:
            along = (x - start.x) * ux + (y - start.y) * uy
            aside = (y - start.y) * ux - (x - start.x) * uy
            is_near = 0.0 < along < length and abs(aside) < self.room
            if is_near and (worst is None or abs(aside) < abs(worst[1])):
                worst = (along, aside)
        if worst is None:
            return []
        along, aside = worst
        out = aside - math.copysign(self.room, aside)
        return [(start.x + along * ux - out * uy, start.y + along * uy + out * ux)]


def main():
    """Serve until told to stop."""
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Avoider())


if __name__ == "__main__":
    main()
