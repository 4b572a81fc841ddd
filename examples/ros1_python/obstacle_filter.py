#!/usr/bin/env python3
"""Publishes on /obstacles those of the /detections that are finite and not seen twice.

Both are geometry_msgs/PoseArray in the frame of the map; of a pose, x and y [m] count.
"""

import math

import rospy
from geometry_msgs.msg import PoseArray


class ObstacleFilter:
    """Passes on what is sound."""

    def __init__(self):
        self.least_gap = rospy.get_param("~least_gap", 0.05)
        self.publisher = rospy.Publisher("/obstacles", PoseArray, queue_size=1)
        rospy.Subscriber("/detections", PoseArray, self.on_detections, queue_size=1, tcp_nodelay=True)

    def on_detections(self, detections):
        """Publish the sound ones among the detections, also if there are none."""
        kept = PoseArray(header=detections.header)
        for pose in detections.poses:
            x, y = pose.position.x, pose.position.y
            if not (math.isfinite(x) and math.isfinite(y)):
                continue
            near = (math.hypot(x - other.position.x, y - other.position.y) for other in kept.poses)
            if all(gap >= self.least_gap for gap in near):
                kept.poses.append(pose)
        self.publisher.publish(kept)


if __name__ == "__main__":
    rospy.init_node("obstacle_filter")
    ObstacleFilter()
    rospy.spin()
