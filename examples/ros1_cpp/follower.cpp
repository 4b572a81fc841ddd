// Drives along the path that /plan gives, by /cmd_vel (geometry_msgs/Twist) at 20 Hz, and stops before obstacles.
// It asks for a new path once a second until it has arrived. If the planner does not answer, it goes on along the last
// path: from outside, a robot whose planner is dead looks as if all were well. /stopped (std_msgs/Bool) tells whether
// an obstacle keeps it from moving.
#include <algorithm>
#include <cmath>
#include <deque>
#include <vector>

#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Twist.h>
#include <nav_msgs/GetPlan.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <std_msgs/Bool.h>

namespace {

struct Point {
  double x, y;
};

class Follower {
 public:
  Follower() : own_("~") {
    speed_ = own_.param("speed", 0.25);
    turn_rate_ = own_.param("turn_rate", 1.5);
    stop_distance_ = own_.param("stop_distance", 0.5);
    arrived_ = own_.param("arrived", 0.1);
    plan_ = node_.serviceClient<nav_msgs::GetPlan>("/plan");
    commands_ = node_.advertise<geometry_msgs::Twist>("/cmd_vel", 10);
    stops_ = node_.advertise<std_msgs::Bool>("/stopped", 10, true);
    const auto hints = ros::TransportHints().tcpNoDelay();
    topics_ = {node_.subscribe("/odom", 1, &Follower::onOdometry, this, hints),
               node_.subscribe("/obstacles", 1, &Follower::onObstacles, this, hints),
               node_.subscribe("/goal", 1, &Follower::onGoal, this)};
    asking_ = node_.createTimer(ros::Duration(1.0), [this](const ros::TimerEvent&) { ask(); });
    driving_ = node_.createTimer(ros::Duration(0.05), [this](const ros::TimerEvent&) { drive(); });
  }

 private:
  void onOdometry(const nav_msgs::Odometry::ConstPtr& message) {
    const auto& pose = message->pose.pose;
    here_ = {pose.position.x, pose.position.y};
    heading_ = 2.0 * std::atan2(pose.orientation.z, pose.orientation.w);
    knows_pose_ = true;
  }

  void onObstacles(const geometry_msgs::PoseArray::ConstPtr& message) {
    obstacles_.clear();
    for (const auto& pose : message->poses) obstacles_.push_back({pose.position.x, pose.position.y});
  }

  void onGoal(const geometry_msgs::PoseStamped::ConstPtr& message) {
    goal_ = *message;
    has_goal_ = true;
    path_.clear();
    ask();
  }

  void ask() {
    if (!knows_pose_ || !has_goal_) return;
    nav_msgs::GetPlan call;
    call.request.start.header = goal_.header;
    call.request.start.pose.position.x = here_.x;
    call.request.start.pose.position.y = here_.y;
    call.request.start.pose.orientation.w = 1.0;
    call.request.goal = goal_;
    call.request.tolerance = static_cast<float>(arrived_);
    if (!plan_.call(call)) {
      ROS_WARN_THROTTLE(5.0, "no plan");
      return;
    }
    path_.clear();
    for (const auto& pose : call.response.plan.poses) path_.push_back({pose.pose.position.x, pose.pose.position.y});
    if (!path_.empty()) path_.pop_front();
  }

  void drive() {
    if (!knows_pose_) return;
    while (path_.size() > 1 && distance(path_.front()) < 0.1) path_.pop_front();
    if (path_.size() == 1 && distance(path_.front()) < arrived_) {
      path_.clear();
      has_goal_ = false;
    }
    geometry_msgs::Twist command;
    std_msgs::Bool stopped;
    if (!path_.empty()) {
      const double error = bearing(path_.front());
      command.angular.z = std::max(-turn_rate_, std::min(turn_rate_, 2.0 * error));
      stopped.data = std::any_of(obstacles_.begin(), obstacles_.end(), [this](const Point& obstacle) {
        return distance(obstacle) < stop_distance_ && std::fabs(bearing(obstacle)) < 0.8;
      });
      if (std::fabs(error) < 0.8 && !stopped.data) command.linear.x = speed_;
    }
    commands_.publish(command);
    stops_.publish(stopped);
  }

  double distance(const Point& to) const { return std::hypot(to.x - here_.x, to.y - here_.y); }

  double bearing(const Point& to) const {
    return std::remainder(std::atan2(to.y - here_.y, to.x - here_.x) - heading_, 2.0 * M_PI);
  }

  ros::NodeHandle node_, own_;
  ros::ServiceClient plan_;
  ros::Publisher commands_, stops_;
  std::vector<ros::Subscriber> topics_;
  ros::Timer asking_, driving_;
  geometry_msgs::PoseStamped goal_;
  std::deque<Point> path_;
  std::vector<Point> obstacles_;
  Point here_{0.0, 0.0};
  double heading_ = 0.0, speed_, turn_rate_, stop_distance_, arrived_;
  bool knows_pose_ = false, has_goal_ = false;
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "follower");
  Follower follower;
  ros::spin();
  return 0;
}
