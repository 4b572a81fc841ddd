"""Asks for a price first of all, and again over a new connection; then bills orders, but not for free."""

import rospy
from geometry_msgs.msg import PointStamped
from nav_msgs.srv import GetPlan


class Client:
    """Blocks in its constructor, as many do."""

    def __init__(self):
        self.menu = rospy.Publisher("/menu", PointStamped, queue_size=1, latch=True)
        self.menu.publish(self.stamped(3.0))
        rospy.wait_for_service("/price")
        self.price = self.asked(1.0) + self.asked(100.0)
        self.bill = rospy.Publisher("/bill", PointStamped, queue_size=10)
        rospy.Subscriber("/order", PointStamped, self.on_order)

    def stamped(self, x):
        """Return a number with the time."""
        message = PointStamped()
        message.header.stamp = rospy.Time.now()
        message.point.x = x
        return message

    def asked(self, x):
        """Return what the clerk tells, twice over a connection that persists, once over one for the call only."""
        request = GetPlan._request_class()
        request.start.pose.position.x = x
        lasting = rospy.ServiceProxy("/price", GetPlan, persistent=True)
        once = rospy.ServiceProxy("/price", GetPlan)
        told = [one.pose.position.x for ask in (lasting, lasting, once) for one in ask(request).plan.poses]
        lasting.close()
        return sum(told) / 3

    def on_order(self, order):
        """Bill what has a price and was ordered at a time."""
        if self.price > 0.0 and order.header.stamp.secs > 0:
            self.bill.publish(self.stamped(order.point.x + self.price))


if __name__ == "__main__":
    rospy.init_node("client")
    Client()
    rospy.spin()
