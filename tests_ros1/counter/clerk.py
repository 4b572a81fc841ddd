"""Adds its fee, a parameter of its own, to what it is asked; repeats what stands on the menu."""

import rospy
from geometry_msgs.msg import PointStamped, PoseStamped
from nav_msgs.srv import GetPlan, GetPlanResponse


def on_ask(request):
    """Answer."""
    told = PoseStamped()
    told.pose.position.x = request.start.pose.position.x + fee
    response = GetPlanResponse()
    response.plan.poses.append(told)
    return response


if __name__ == "__main__":
    rospy.init_node("clerk")
    fee = rospy.get_param("~fee")
    posted = rospy.Publisher("/posted", PointStamped, queue_size=1, latch=True)
    rospy.Subscriber("/menu", PointStamped, posted.publish)
    rospy.Service("/price", GetPlan, on_ask)
    rospy.spin()
