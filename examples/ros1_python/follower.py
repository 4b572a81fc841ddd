#!/usr/bin/env python3
"""Drives along the path that /plan gives, by /cmd_vel (geometry_msgs/Twist) at 20 Hz, and stops before obstacles.

It asks for a new path once a second until it has arrived. If the planner does not answer, it goes on along the last
path: from outside, a robot whose planner is dead looks as if all were well. /stopped (std_msgs/Bool) tells whether an
obstacle keeps it from moving.
"""

import math
import threading

import rospy
from geometry_msgs.msg import PoseArray, PoseStamped, Twist
from nav_msgs.msg import Odometry
from nav_msgs.srv import GetPlan
from std_msgs.msg import Bool


class Follower:
    """Keeps pose, goal, path and obstacles, and drives."""

    def __init__(self):
        self.speed = rospy.get_param("~speed", 0.25)
        self.turn_rate = rospy.get_param("~turn_rate", 1.5)
        self.stop_distance = rospy.get_param("~stop_distance", 0.5)
        self.arrived = rospy.get_param("~arrived", 0.1)
        self.lock, self.asking = threading.Lock(), threading.Lock()
        self.pose = self.goal = None
        self.path, self.obstacles = [], []
        self.plan = rospy.ServiceProxy("/plan", GetPlan)
        # Each command belongs to one /stopped: with queues of one, a busy machine would drop either of them.
        self.commands = rospy.Publisher("/cmd_vel", Twist, queue_size=10)
        self.stops = rospy.Publisher("/stopped", Bool, queue_size=10, latch=True)
        rospy.Subscriber("/odom", Odometry, self.on_odometry, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("/obstacles", PoseArray, self.on_obstacles, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("/goal", PoseStamped, self.on_goal, queue_size=1)
        rospy.Timer(rospy.Duration(1.0), self.ask)
        rospy.Timer(rospy.Duration(0.05), self.drive)

    def on_odometry(self, odometry):
        """Take up where the robot is."""
        position, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
        with self.lock:
            self.pose = (position.x, position.y, 2.0 * math.atan2(turn.z, turn.w))

    def on_obstacles(self, obstacles):
        """Take up where obstacles are."""
        with self.lock:
            self.obstacles = [(pose.position.x, pose.position.y) for pose in obstacles.poses]

    def on_goal(self, goal):
        """Forget the old path, and ask for one to the new goal."""
        with self.lock:
            self.goal, self.path = goal, []
        self.ask(None)

    def ask(self, _event):
        """Ask the planner for a path from here, one question at a time; keep the old one if it does not answer."""
        with self.asking:
            self.ask_now()

    def ask_now(self):
        """Ask, and wait for the answer."""
        with self.lock:
            pose, goal = self.pose, self.goal
        if pose is None or goal is None:
            return
        start = PoseStamped(header=goal.header)
        start.pose.position.x, start.pose.position.y = pose[0], pose[1]
        start.pose.orientation.w = 1.0
        try:
            answer = self.plan(start=start, goal=goal, tolerance=self.arrived)
        except rospy.ServiceException as error:
            rospy.logwarn_throttle(5.0, "no plan: %s", error)
            return
        with self.lock:
            if self.goal is goal:
                self.path = [(p.pose.position.x, p.pose.position.y) for p in answer.plan.poses][1:]

    def drive(self, _event):
        """Send one command: towards the next corner of the path, or nothing."""
        with self.lock:
            if self.pose is None:
                return
            x, y, heading = self.pose
            while len(self.path) > 1 and math.hypot(self.path[0][0] - x, self.path[0][1] - y) < 0.1:
                self.path.pop(0)
            if len(self.path) == 1 and math.hypot(self.path[0][0] - x, self.path[0][1] - y) < self.arrived:
                self.goal, self.path = None, []
            path, obstacles = list(self.path), list(self.obstacles)
        command, stopped = Twist(), False
        if path:
            error = math.remainder(math.atan2(path[0][1] - y, path[0][0] - x) - heading, 2.0 * math.pi)
            command.angular.z = max(-self.turn_rate, min(self.turn_rate, 2.0 * error))
            stopped = any(self.is_ahead(x, y, heading, *obstacle) for obstacle in obstacles)
            if abs(error) < 0.8 and not stopped:
                command.linear.x = self.speed
        self.commands.publish(command)
        self.stops.publish(Bool(stopped))

    def is_ahead(self, x, y, heading, ox, oy):
        """Return whether an obstacle is near, and before the robot."""
        bearing = math.remainder(math.atan2(oy - y, ox - x) - heading, 2.0 * math.pi)
        return math.hypot(ox - x, oy - y) < self.stop_distance and abs(bearing) < 0.8


if __name__ == "__main__":
    rospy.init_node("follower")
    Follower()
    rospy.spin()
