// Live nodes on a ROS 1 graph -> commands and messages to them, reports and messages from them.
#pragma once

#include <algorithm>
#include <cstdlib>

#include "parcours_ends.hpp"

namespace parcours {

constexpr const char* TESTER = "/parcours";
constexpr const char* INLINE = "=";  // begins a message that travels within its report
constexpr const char* CALL = "?";    // announces a response to a call that the node is to make

/// The seconds that a variable of the environment gives, or else so many.
inline double seconds_of(const char* name, double otherwise) {
  const char* given = std::getenv(name);
  return given ? std::atof(given) : otherwise;
}

class Graph {
 public:
  /// Enter the graph, and wait for a node of each of these components. Throws HostError.
  Graph(const Channel* channels, int n_channels, const std::vector<std::string>& components)
      : channels_(channels), n_channels_(n_channels), nodes_(components.begin(), components.end()), ends_(n_channels) {
    await_master();
    try {
      enter();
    } catch (...) {
      leave();
      throw;
    }
  }
  ~Graph() { leave(); }

  const Channel& channel(int k) const { return channels_[k]; }
  bool lives(const std::string& node) const { return !lost_.count(node); }
  bool is_busy(int k) const { return ends_[k].caller && ends_[k].caller->busy(); }

  void command(const std::string& node, const Packer& frame) {
    std_msgs::UInt8MultiArray message;
    message.data.assign(frame.packed().begin(), frame.packed().end());
    commands_.at(node).publish(message);
  }

  /// Let a message reach its receiver, if that is a node; what announces it follows.
  void deliver(int k, int number, std::string_view data) {
    const Channel& one = channels_[k];
    if (!nodes_.count(one.receiver)) return;
    std::string_view announced;
    End& end = ends_[k];
    if (one.role == Role::topic) {
      end.out.publish(Raw{std::string(data)});
    } else if (one.role == Role::request) {
      end.caller->ask(std::string(data));
    } else if (!ends_[one.other].desk->answer(std::string(data))) {
      announced = CALL;
    }
    Packer frame;
    frame.array(3).text("Deliver").integer(number).array(2).text(one.name).bytes(announced);
    command(one.receiver, frame);
  }

  /// The next report of a node, with the messages that belong to it; nothing if none comes.
  std::optional<Report> poll(Until until) {
    while (said_.empty()) {
      if (!ros::ok()) throw HostError("interrupted");
      const Until slice = std::min(until, after_seconds(0.05));
      queue_.callAvailable(ros::WallDuration(std::max(0.0, std::chrono::duration<double>(slice - Steady::now()).count())));
      if (!said_.empty()) break;
      for (auto& [name, subscriber] : reports_)
        if (lives(name) && complete_ && subscriber.getNumPublishers() == 0) {
          lost_.insert(name);
          Report died;
          died.node = name;
          died.kind = "Died";
          return died;
        }
      if (Steady::now() >= until) return std::nullopt;
    }
    auto [node, frame] = std::move(said_.front());
    said_.pop_front();
    Report report = read(node, Unpacker::value_of(frame));
    if (report.kind == "Ready") decline(node);
    return report;
  }

 private:
  struct End {
    ros::Publisher out;
    ros::Subscriber in;
    std::deque<std::string> heard;  // filled by the thread that polls
    boost::shared_ptr<Desk> desk;
    ros::ServiceServer server;
    std::unique_ptr<Caller> caller;
  };

  static void await_master() {
    const Until until = after_seconds(5.0);
    while (!ros::master::check()) {
      if (Steady::now() > until)
        throw HostError("ROS master " + ros::master::getURI() + ": must answer within 5 s, but does not; start it "
                        "(roscore), or correct ROS_MASTER_URI");
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  }

  void enter() {
    node_ = std::make_unique<ros::NodeHandle>();
    node_->setCallbackQueue(&queue_);
    send_at_once();
    for (int k = 0; k < n_channels_; ++k) connect(k);
    for (const std::string& name : nodes_) {
      reports_[name] = node_->subscribe<std_msgs::UInt8MultiArray>(
          TESTER + ("/" + name) + "/report", 0,
          [this, name](const std_msgs::UInt8MultiArray::ConstPtr& said) {
            said_.emplace_back(name, std::string(said->data.begin(), said->data.end()));
          },
          ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
    }
    // Nodes wait for this last sign that the tester is complete.
    for (const std::string& name : nodes_)
      commands_[name] = node_->advertise<std_msgs::UInt8MultiArray>(TESTER + ("/" + name) + "/command", 0);
    await_nodes(seconds_of("PARCOURS_NODES_WITHIN", 60.0));
    for (int k = 0; k < n_channels_; ++k)
      if (channels_[k].role == Role::request && nodes_.count(channels_[k].receiver)) call(k);
    send_at_once();
  }

  void leave() {
    for (End& end : ends_)
      if (end.desk) end.desk->close();
    spinners_.clear();
    ends_.clear();
    reports_.clear();
    commands_.clear();
    node_.reset();
    ros::shutdown();
  }

  void connect(int k) {
    const Channel& one = channels_[k];
    const bool comes = nodes_.count(one.sender), goes = nodes_.count(one.receiver);
    End& end = ends_[k];
    const std::string out = std::string(TESTER) + "/out" + one.topic;
    if (one.role == Role::topic && comes) {
      ros::SubscribeOptions wanted(out, 0, one.md5sum, one.type);
      wanted.helper = boost::make_shared<ros::SubscriptionCallbackHelperT<const boost::shared_ptr<Raw const>&>>(
          [&end](const boost::shared_ptr<Raw const>& raw) { end.heard.push_back(raw->data); });
      wanted.transport_hints = ros::TransportHints().tcpNoDelay();
      end.in = node_->subscribe(wanted);
    }
    if (one.role == Role::topic && goes) {
      ros::AdvertiseOptions offered(one.topic, 0, one.md5sum, one.type, one.definition);
      end.out = node_->advertise(offered);
    }
    if (one.role == Role::request && comes) {
      end.desk = boost::make_shared<Desk>();
      desk_queues_.push_back(std::make_unique<ros::CallbackQueue>());
      ros::AdvertiseServiceOptions offered;
      offered.service = out;
      offered.md5sum = one.md5sum;
      offered.datatype = one.type;
      offered.req_datatype = one.type + std::string("Request");
      offered.res_datatype = one.type + std::string("Response");
      offered.helper = end.desk;
      offered.callback_queue = desk_queues_.back().get();
      end.server = node_->advertiseService(offered);
      spinners_.push_back(std::make_unique<ros::AsyncSpinner>(1, desk_queues_.back().get()));
      spinners_.back()->start();
    }
  }

  void call(int k) {
    const Channel& one = channels_[k];
    ros::ServiceClientOptions wanted(one.topic, one.md5sum, true, {});
    ros::ServiceClient client = node_->serviceClient(wanted);
    if (!client.isValid())
      throw HostError(std::string("service ") + one.topic + ": must be served by " + one.receiver + " as " + one.type +
                      ", but cannot be called");
    ends_[k].caller = std::make_unique<Caller>(client, one.md5sum);
  }

  void await_nodes(double within) {
    std::set<std::string> missing = nodes_;
    const Until until = after_seconds(within);
    while (!missing.empty()) {
      if (const auto report = poll(std::min(until, after_seconds(0.2)))) missing.erase(report->node);
      if (Steady::now() > until && !missing.empty()) {
        std::string names;
        for (const std::string& name : missing) names += " " + name;
        throw HostError("ROS master " + ros::master::getURI() + ": nodes must join the tester within " +
                        std::to_string(static_cast<int>(within)) + " s (PARCOURS_NODES_WITHIN), but missing are:" +
                        names + "; start them with launch_nodes.sh");
      }
    }
    complete_ = true;
  }

  std::string taken(int k, const std::string& data) {
    if (!data.empty()) return data.substr(data.rfind(INLINE, 0) == 0 ? 1 : 0);
    const Until until = after_seconds(2.0);
    End& end = ends_[k];
    std::optional<std::string> found;
    if (channels_[k].role == Role::request && end.desk) {
      found = end.desk->take(until);
    } else if (channels_[k].role == Role::response && ends_[channels_[k].other].caller) {
      found = ends_[channels_[k].other].caller->take(until);
    } else {
      while (end.heard.empty() && Steady::now() < until) queue_.callAvailable(ros::WallDuration(0.01));
      if (!end.heard.empty()) {
        found = std::move(end.heard.front());
        end.heard.pop_front();
      }
    }
    if (!found) throw HostError(std::string("a node must send what it reports within 2 s, but nothing came on ") +
                                channels_[k].name);
    return *found;
  }

  Message message(const Value& wire, bool joined) {
    const std::string &name = item(wire, 0).text, &data = item(wire, 1).text;
    for (int k = 0; k < n_channels_; ++k)
      if (name == channels_[k].name) return Message{name, k, joined ? taken(k, data) : data};
    return Message{name, -1, data};
  }

  static const Value& item(const Value& array, std::size_t k) {
    if (array.items.size() <= k) throw HostError("a node's report is no frame of this version: too short");
    return array.items[k];
  }

  Report read(const std::string& node, const Value& frame) {
    Report report;
    report.node = node;
    report.kind = item(frame, 0).text;
    if (report.kind == "Turned") {
      report.reference = item(frame, 1).integer;
      report.manner = item(frame, 2).text;
      report.time = item(frame, 3).integer;
      report.transition = item(frame, 4).text;
      for (const Value& aside : item(frame, 7).items)
        report.asides.emplace_back(item(aside, 0).integer, message(item(aside, 1), true));
      for (const Value& wire : item(frame, 5).items) report.sends.push_back(message(wire, true));
      report.received = item(frame, 6).integer;
      report.text = item(frame, 8).text;
    } else if (report.kind == "ViewShown") {
      report.reference = item(frame, 1).integer;
      if (!item(frame, 2).items.empty()) report.sends.push_back(message(item(frame, 2), false));
    }
    return report;
  }

  void decline(const std::string& node) {
    for (int k = 0; k < n_channels_; ++k)
      if (ends_[k].desk && node == channels_[k].sender) ends_[k].desk->decline();
  }

  const Channel* channels_;
  int n_channels_;
  bool complete_ = false;
  std::set<std::string> nodes_, lost_;
  std::deque<std::pair<std::string, std::string>> said_;
  ros::CallbackQueue queue_;
  std::vector<std::unique_ptr<ros::CallbackQueue>> desk_queues_;
  std::unique_ptr<ros::NodeHandle> node_;
  std::vector<End> ends_;
  std::vector<std::unique_ptr<ros::AsyncSpinner>> spinners_;
  std::map<std::string, ros::Subscriber> reports_;
  std::map<std::string, ros::Publisher> commands_;
};

}  // namespace parcours
