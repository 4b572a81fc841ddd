#!/usr/bin/env python3
"""Serves /navigate_to_pose (nav2_msgs/NavigateToPose): plans on the map by A*, and drives along the way that it finds.

Listens to /tf (map to base_link), /map (nav_msgs/OccupancyGrid, latched) and /obstacles (geometry_msgs/PoseArray), and
publishes /cmd_vel (geometry_msgs/Twist) at 10 Hz while there is a goal. A new goal takes the place of the last one.
"""

import contextlib
import heapq
import math

import numpy as np
import rclpy
from geometry_msgs.msg import PoseArray, Twist
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from tf2_msgs.msg import TFMessage

STEPS = [(i, j, math.hypot(i, j)) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]


class Navigator(Node):
    """Keeps the map and the robot's frames; a goal's coroutine waits for the timer that drives."""

    def __init__(self):
        super().__init__("navigator")
        self.speed = self.declare_parameter("speed", 0.4).value
        self.clearance = self.declare_parameter("clearance", 0.3).value
        self.stop_distance = self.declare_parameter("stop_distance", 0.55).value
        self.arrived = self.declare_parameter("arrived", 0.1).value
        self.frames, self.others = {}, []
        self.map = self.goal = self.done = None
        self.path = []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.commands = self.create_publisher(Twist, "/cmd_vel", 1)
        self.create_subscription(TFMessage, "/tf", self.on_frames, 10)
        self.create_subscription(OccupancyGrid, "/map", self.on_map, latched)
        self.create_subscription(PoseArray, "/obstacles", self.on_obstacles, 1)
        self.create_timer(0.1, self.drive)
        ActionServer(self, NavigateToPose, "/navigate_to_pose", self.execute, goal_callback=self.on_goal,
                     cancel_callback=lambda goal: CancelResponse.ACCEPT)  # fmt: skip

    def on_frames(self, message):
        """Take up where frames are in their parents."""
        for one in message.transforms:
            place, turn = one.transform.translation, one.transform.rotation
            self.frames[one.child_frame_id] = one.header.frame_id, place.x, place.y, 2.0 * math.atan2(turn.z, turn.w)

    def on_map(self, message):
        """Take up the ground, and what is too near a wall."""
        n = math.ceil(self.clearance / message.info.resolution)
        walls = np.array(message.data, np.int8).reshape(message.info.height, message.info.width) != 0
        near = np.zeros_like(walls)
        for i, j in zip(*np.nonzero(walls), strict=True):
            near[max(0, i - n) : i + n + 1, max(0, j - n) : j + n + 1] = True
        self.map = message.info, near

    def on_obstacles(self, message):
        """Take up where others are."""
        self.others = [(one.position.x, one.position.y) for one in message.poses]

    def pose(self):
        """Return where the robot is on the map, None if nobody said."""
        x = y = heading = 0.0
        frame = "base_link"
        while frame != "map":
            if frame not in self.frames:
                return None
            frame, there_x, there_y, turn = self.frames[frame]
            s, c = math.sin(turn), math.cos(turn)
            x, y, heading = there_x + c * x - s * y, there_y + s * x + c * y, heading + turn
        return x, y, heading

    def on_goal(self, request):
        """Accept a goal if the robot knows where it is."""
        return GoalResponse.ACCEPT if self.map and self.pose() else GoalResponse.REJECT

    async def execute(self, goal):
        """Drive there; the timer says when it is over."""
        if self.done is not None:
            self.done.set_result("another goal came")
        done = self.done = Future()
        self.goal = goal
        target = goal.request.pose.pose.position
        self.path = self.plan(self.pose()[:2], (target.x, target.y))
        why = await done if self.path else "there is no way"
        if self.goal is goal:
            self.goal = self.done = None
        result = NavigateToPose.Result(error_msg=why)
        if goal.is_cancel_requested:
            goal.canceled()
        elif why:
            result.error_code = NavigateToPose.Result.UNKNOWN
            goal.abort()
        else:
            goal.succeed()
        return result

    def plan(self, start, goal):
        """Return the points of the shortest way on the map, [] if there is none."""
        info, near = self.map
        corner, size = info.origin.position, info.resolution

        def cell(point):
            return int((point[1] - corner.y) / size), int((point[0] - corner.x) / size)

        def free(i, j):
            return 0 <= i < near.shape[0] and 0 <= j < near.shape[1] and not near[i, j]

        first, last = cell(start), cell(goal)
        queue, came, cost = [(0.0, first)], {first: None}, {first: 0.0}
        while queue:
            _, here = heapq.heappop(queue)
            if here == last:
                way = [goal]
                while here is not None:
                    way.append((corner.x + (here[1] + 0.5) * size, corner.y + (here[0] + 0.5) * size))
                    here = came[here]
                return way[::-1]
            for i, j, length in STEPS:
                there = here[0] + i, here[1] + j
                if free(*there) and cost[here] + length < cost.get(there, math.inf):
                    cost[there], came[there] = cost[here] + length, here
                    heapq.heappush(queue, (cost[there] + math.dist(there, last), there))
        return []

    def drive(self):
        """Publish the arc to a point ahead on the way, if there is a goal."""
        if self.goal is None or self.done is None or not self.path:
            return
        x, y, heading = self.pose()
        command = Twist()
        left = math.dist(self.path[-1], (x, y))
        if self.goal.is_cancel_requested or left < self.arrived:
            self.done.set_result("")
            self.path = []
        else:
            while len(self.path) > 1 and math.dist(self.path[0], (x, y)) < 0.4:
                self.path.pop(0)
            dx, dy = self.path[0][0] - x, self.path[0][1] - y
            ahead, aside = (
                dx * math.cos(heading) + dy * math.sin(heading),
                dy * math.cos(heading) - dx * math.sin(heading),
            )
            if ahead <= 0.3 * abs(aside):
                command.angular.z = math.copysign(0.8, aside)
            elif not self.is_blocked(x, y, heading):
                command.linear.x = self.speed
                command.angular.z = 2.0 * self.speed * aside / (dx * dx + dy * dy)
            self.goal.publish_feedback(NavigateToPose.Feedback(distance_remaining=left))
        self.commands.publish(command)

    def is_blocked(self, x, y, heading):
        """Return whether somebody is ahead and near."""
        for there_x, there_y in self.others:
            along = (there_x - x) * math.cos(heading) + (there_y - y) * math.sin(heading)
            aside = (there_y - y) * math.cos(heading) - (there_x - x) * math.sin(heading)
            if 0.0 < along < self.stop_distance + 0.2 and abs(aside) < 0.5:
                return True
        return False


def main():
    """Serve until told to stop."""
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Navigator())


if __name__ == "__main__":
    main()
