// A table of channels -> the tester's ends on a ROS 1 graph: it stands between every sender and its receiver.
// A sender speaks under /parcours/out, where the tester hears it; the tester offers the usual name to the receiver.
// Messages travel as they are, in bytes, under the type and checksum of the table.
#pragma once

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <condition_variable>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <thread>

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/service_callback_helper.h>
#include <std_msgs/UInt8MultiArray.h>

#include "parcours_clock.hpp"
#include "parcours_frames.hpp"

namespace parcours {

/// A message as bytes.
struct Raw {
  std::string data;
};

}  // namespace parcours

namespace ros::message_traits {
template <> struct IsMessage<parcours::Raw> : TrueType {};
template <> struct IsMessage<const parcours::Raw> : TrueType {};
template <> struct MD5Sum<parcours::Raw> {
  static const char* value() { return "*"; }
  static const char* value(const parcours::Raw&) { return "*"; }
};
template <> struct DataType<parcours::Raw> {
  static const char* value() { return "*"; }
  static const char* value(const parcours::Raw&) { return "*"; }
};
template <> struct Definition<parcours::Raw> {
  static const char* value() { return ""; }
  static const char* value(const parcours::Raw&) { return ""; }
};
}  // namespace ros::message_traits

namespace ros::serialization {
template <> struct Serializer<parcours::Raw> {
  template <typename Stream> static void write(Stream& stream, const parcours::Raw& raw) {
    std::memcpy(stream.advance(raw.data.size()), raw.data.data(), raw.data.size());
  }
  template <typename Stream> static void read(Stream& stream, parcours::Raw& raw) {
    const auto size = stream.getLength();
    raw.data.assign(reinterpret_cast<const char*>(stream.advance(size)), size);
  }
  static uint32_t serializedLength(const parcours::Raw& raw) { return raw.data.size(); }
};
}  // namespace ros::serialization

namespace parcours {

/// roscpp leaves Nagle's algorithm on where services travel, which adds 40 ms to answers in a row. Connections inherit
/// the option from the socket that listens.
inline void send_at_once() {
  const int on = 1;
  for (int descriptor = 3; descriptor < 1024; ++descriptor)
    setsockopt(descriptor, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);  // refused by what is no TCP socket
}

enum class Role { topic, request, response };

/// A channel of the model; `other` is the place of a service's other half, `fields` reads "f1 fitness, ...".
struct Channel {
  const char *name, *sender, *receiver;
  Role role;
  const char *topic, *type, *md5sum, *definition;
  int other;
  const char* fields;
};

/// Messages that wait, for one thread, until another takes them.
class Waiting {
 public:
  void put(std::string data) {
    std::lock_guard<std::mutex> lock(mutex_);
    messages_.push_back(std::move(data));
    there_.notify_all();
  }
  std::optional<std::string> take(Until until) {
    std::unique_lock<std::mutex> lock(mutex_);
    if (!there_.wait_until(lock, until, [&] { return !messages_.empty(); })) return std::nullopt;
    return pop();
  }

 protected:
  std::string pop() {
    std::string first = std::move(messages_.front());
    messages_.pop_front();
    return first;
  }
  std::mutex mutex_;
  std::condition_variable there_;
  std::deque<std::string> messages_;
};

/// A service that a node calls. A call is held until there is an answer; the first answer goes to the first call, whose
/// ever it is, since a node tells answers apart by their order. roscpp reads one call of a client at a time: the call
/// that is held is given up (refused, which the node skips) if the node has said that it has made another. An answer for
/// which there is no call any more, or never was one, goes to an empty call, which the node is asked to make.
class Desk : public ros::ServiceCallbackHelper, public Waiting {
 public:
  bool call(ros::ServiceCallbackHelperCallParams& params) override {
    std::unique_lock<std::mutex> lock(mutex_);
    if (params.request.num_bytes > 0)
      messages_.emplace_back(reinterpret_cast<const char*>(params.request.message_start), params.request.num_bytes);
    held_ = true;
    there_.notify_all();
    there_.wait(lock, [&] { return !answers_.empty() || given_up_ || closed_ || (wanted_ && messages_.empty()); });
    held_ = given_up_ = false;
    const bool answered = !answers_.empty();
    std::string told = "not answered";
    if (answered) {
      told = std::move(answers_.front());
      answers_.pop_front();
    }
    const std::uint32_t size = told.size();
    boost::shared_array<uint8_t> data(new uint8_t[5 + size]);
    data[0] = answered;
    std::memcpy(data.get() + 1, &size, 4);  // little-endian, as ROS 1 is
    std::memcpy(data.get() + 5, told.data(), size);
    params.response = ros::SerializedMessage(data, 5 + size);
    return answered;
  }
  std::optional<std::string> take(Until until) {
    std::unique_lock<std::mutex> lock(mutex_);
    wanted_ = true;
    there_.notify_all();
    const bool came = there_.wait_until(lock, until, [&] { return !messages_.empty(); });
    wanted_ = false;
    return came ? std::optional<std::string>(pop()) : std::nullopt;
  }
  /// Answer the next call; return whether there is one already.
  bool answer(std::string data) {
    std::lock_guard<std::mutex> lock(mutex_);
    const bool is_there = held_ && answers_.empty();
    answers_.push_back(std::move(data));
    there_.notify_all();
    return is_there;
  }
  void decline() {
    std::lock_guard<std::mutex> lock(mutex_);
    given_up_ = held_;
    there_.notify_all();
  }
  void close() {
    std::lock_guard<std::mutex> lock(mutex_);
    closed_ = true;
    there_.notify_all();
  }

 private:
  bool held_ = false, wanted_ = false, given_up_ = false, closed_ = false;
  std::deque<std::string> answers_;
};

/// A client of a node's service, in a thread of its own, over one lasting connection.
class Caller : public Waiting {
 public:
  Caller(ros::ServiceClient client, std::string md5sum)
      : client_(std::move(client)), md5sum_(std::move(md5sum)), thread_([this] { serve(); }) {}
  ~Caller() {
    {
      std::lock_guard<std::mutex> lock(asking_);
      closed_ = true;
      asked_.notify_all();
    }
    client_.shutdown();
    thread_.join();
  }
  void ask(std::string data) {
    std::lock_guard<std::mutex> lock(asking_);
    requests_.push_back(std::move(data));
    ++open_;
    asked_.notify_all();
  }
  bool busy() {
    std::lock_guard<std::mutex> lock(asking_);
    return open_ > 0;
  }

 private:
  void serve() {
    std::unique_lock<std::mutex> lock(asking_);
    while (true) {
      asked_.wait(lock, [&] { return closed_ || !requests_.empty(); });
      if (closed_) return;
      const std::string request = std::move(requests_.front());
      requests_.pop_front();
      lock.unlock();
      const std::uint32_t size = request.size();
      boost::shared_array<uint8_t> data(new uint8_t[4 + size]);
      std::memcpy(data.get(), &size, 4);
      std::memcpy(data.get() + 4, request.data(), size);
      ros::SerializedMessage asked(data, 4 + size), told;
      if (client_.call(asked, told, md5sum_))
        put(std::string(reinterpret_cast<const char*>(told.message_start),
                        told.num_bytes - (told.message_start - told.buf.get())));
      lock.lock();
      --open_;
    }
  }
  ros::ServiceClient client_;
  std::string md5sum_;
  std::mutex asking_;
  std::condition_variable asked_;
  std::deque<std::string> requests_;
  int open_ = 0;
  bool closed_ = false;
  std::thread thread_;
};

}  // namespace parcours
