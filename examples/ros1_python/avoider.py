#!/usr/bin/env python3
"""Serves /plan (nav_msgs/GetPlan): a path from start to goal that bends around the obstacle that is most in the way.

It knows obstacles from /obstacles (geometry_msgs/PoseArray); each is a disc of radius ~obstacle_radius [m].
"""

import math
import threading

import rospy
from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.srv import GetPlan, GetPlanResponse


class Avoider:
    """Keeps the obstacles, and answers."""

    def __init__(self):
        self.room = rospy.get_param("~obstacle_radius", 0.2) + rospy.get_param("~robot_radius", 0.2)
        self.margin = rospy.get_param("~margin", 0.15)
        self.lock = threading.Lock()
        self.obstacles = []
        rospy.Subscriber("/obstacles", PoseArray, self.on_obstacles, queue_size=1, tcp_nodelay=True)
        rospy.Service("/plan", GetPlan, self.on_plan)

    def on_obstacles(self, obstacles):
        """Take up where obstacles are."""
        with self.lock:
            self.obstacles = [(pose.position.x, pose.position.y) for pose in obstacles.poses]

    def on_plan(self, request):
        """Answer with a path of two or three corners."""
        start, goal = request.start.pose.position, request.goal.pose.position
        with self.lock:
            obstacles = list(self.obstacles)
        points = [(start.x, start.y), *self.way_round(start, goal, obstacles), (goal.x, goal.y)]
        response = GetPlanResponse()
        response.plan.header.stamp = rospy.Time.now()
        response.plan.header.frame_id = request.goal.header.frame_id or "map"
        for x, y in points:
            pose = PoseStamped(header=response.plan.header)
            pose.pose.position.x, pose.pose.position.y = x, y
            pose.pose.orientation.w = 1.0
            response.plan.poses.append(pose)
        return response

    def way_round(self, start, goal, obstacles):
        """Return no point, or the one beside the obstacle that leaves the least room on the straight line."""
        dx, dy = goal.x - start.x, goal.y - start.y
        length = math.hypot(dx, dy)
        if length < 1e-6:
            return []
        ux, uy = dx / length, dy / length
        worst = None
        for x, y in obstacles:
            along = (x - start.x) * ux + (y - start.y) * uy
            aside = (y - start.y) * ux - (x - start.x) * uy
            is_near = 0.0 < along < length and abs(aside) < self.room + self.margin
            if is_near and (worst is None or abs(aside) < abs(worst[1])):
                worst = (along, aside)
        if worst is None:
            return []
        along, aside = worst
        shift = aside - math.copysign(self.room + 2.0 * self.margin, aside)
        return [(start.x + along * ux - shift * uy, start.y + along * uy + shift * ux)]


if __name__ == "__main__":
    rospy.init_node("avoider")
    Avoider()
    rospy.spin()
