// Serves /plan (nav_msgs/GetPlan): a path from start to goal that bends around the obstacle that is most in the way.
// It knows obstacles from /obstacles (geometry_msgs/PoseArray); each is a disc of radius ~obstacle_radius [m].
#include <cmath>
#include <mutex>
#include <vector>

#include <geometry_msgs/PoseArray.h>
#include <nav_msgs/GetPlan.h>
#include <ros/ros.h>

namespace {

struct Point {
  double x, y;
};

class Avoider {
 public:
  Avoider() : own_("~") {
    room_ = own_.param("obstacle_radius", 0.2) + own_.param("robot_radius", 0.2);
    margin_ = own_.param("margin", 0.15);
    obstacles_topic_ = node_.subscribe("/obstacles", 1, &Avoider::onObstacles, this,
                                       ros::TransportHints().tcpNoDelay());
    service_ = node_.advertiseService("/plan", &Avoider::onPlan, this);
  }

 private:
  void onObstacles(const geometry_msgs::PoseArray::ConstPtr& message) {
    std::lock_guard<std::mutex> hold(lock_);
    obstacles_.clear();
    for (const auto& pose : message->poses) obstacles_.push_back({pose.position.x, pose.position.y});
  }

  bool onPlan(nav_msgs::GetPlan::Request& request, nav_msgs::GetPlan::Response& response) {
    const auto& start = request.start.pose.position;
    const auto& goal = request.goal.pose.position;
    std::vector<Point> points = {{start.x, start.y}};
    {
      std::lock_guard<std::mutex> hold(lock_);
      addWayRound({start.x, start.y}, {goal.x, goal.y}, points);
    }
    points.push_back({goal.x, goal.y});
    response.plan.header.stamp = ros::Time::now();
    response.plan.header.frame_id = request.goal.header.frame_id.empty() ? "map" : request.goal.header.frame_id;
    for (const Point& point : points) {
      geometry_msgs::PoseStamped pose;
      pose.header = response.plan.header;
      pose.pose.position.x = point.x;
      pose.pose.position.y = point.y;
      pose.pose.orientation.w = 1.0;
      response.plan.poses.push_back(pose);
    }
    return true;
  }

  // Adds a point beside the obstacle that leaves the least room on the straight line, if one is in the way.
  void addWayRound(Point start, Point goal, std::vector<Point>& points) const {
    const double length = std::hypot(goal.x - start.x, goal.y - start.y);
    if (length < 1e-6) return;
    const double ux = (goal.x - start.x) / length, uy = (goal.y - start.y) / length;
    bool found = false;
    double worst_along = 0.0, worst_aside = 0.0;
    for (const Point& obstacle : obstacles_) {
      const double along = (obstacle.x - start.x) * ux + (obstacle.y - start.y) * uy;
      const double aside = (obstacle.y - start.y) * ux - (obstacle.x - start.x) * uy;
      if (along <= 0.0 || along >= length || std::fabs(aside) >= room_ + margin_) continue;
      if (found && std::fabs(aside) >= std::fabs(worst_aside)) continue;
      found = true;
      worst_along = along;
      worst_aside = aside;
    }
    if (!found) return;
    const double shift = worst_aside - std::copysign(room_ + 2.0 * margin_, worst_aside);
    points.push_back({start.x + worst_along * ux - shift * uy, start.y + worst_along * uy + shift * ux});
  }

  ros::NodeHandle node_, own_;
  ros::Subscriber obstacles_topic_;
  ros::ServiceServer service_;
  std::mutex lock_;
  std::vector<Point> obstacles_;
  double room_, margin_;
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "avoider");
  Avoider avoider;
  ros::spin();
  return 0;
}
