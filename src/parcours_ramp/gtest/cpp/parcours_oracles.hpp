// Expected results of Table VIII: what components of RAMP sent in a case -> whether it is as expected, and why not.
#pragma once

#include <cmath>
#include <sstream>

#include "parcours_enforcement.hpp"

namespace parcours {


/// The fields of a message by name. ROS 1 writes them one after the other, little-endian, arrays after their length.
class Fields {
 public:
  Fields(const Channel& channel, std::string_view data) {
    std::istringstream list(channel.fields);
    std::string kind, name;
    std::size_t at = 0;
    while (list >> kind >> name) {
      std::size_t size = kind == "bool" ? 1 : 8;
      if (kind.size() > 2 && kind.substr(kind.size() - 2) == "[]") {
        std::uint32_t n = 0;
        copy(&n, data, at, 4);
        at += 4;
        size = 8 * static_cast<std::size_t>(n);
      }
      if (size > data.size() - at) throw HostError(std::string("a message on ") + channel.name + " ends within " + name);
      fields_[name] = data.substr(at, size);
      at += size;
    }
  }
  template <typename Number> std::vector<Number> numbers(const char* name) const {
    const std::string_view field = fields_.at(name);
    std::vector<Number> found(field.size() / sizeof(Number));
    if (!found.empty()) std::memcpy(found.data(), field.data(), found.size() * sizeof(Number));
    return found;
  }
  std::vector<double> floats(const char* name) const { return numbers<double>(name); }
  std::vector<std::int64_t> ints(const char* name) const { return numbers<std::int64_t>(name); }
  std::string_view bytes(const char* name) const { return fields_.at(name); }

 private:
  static void copy(void* target, std::string_view data, std::size_t at, std::size_t size) {
    if (at + size > data.size()) throw HostError("a message ends too early");
    std::memcpy(target, data.data() + at, size);
  }
  std::map<std::string, std::string_view> fields_;
};

inline std::vector<Fields> on_channel(const Run& run, const std::vector<Message>& messages, std::string_view name) {
  std::vector<Fields> found;
  for (const Message& one : messages)
    if (one.channel >= 0 && name == one.name) found.emplace_back(run.channels[one.channel], one.data);
  return found;
}

using Judged = std::pair<bool, std::string>;

/// ITP1: 10 <= size(trajectory) <= 500.
inline Judged trajectory_size(const Run& run) {
  bool any = false, holds = true;
  std::ostringstream why;
  why << "sizes of the trajectories:";
  for (const Fields& answer : on_channel(run, run.sent, "trajectory_response")) {
    std::vector<std::int64_t> sizes = answer.ints("prediction_counts");
    const auto counts = answer.ints("trajectory_counts");  // samples, pieces, legs of each
    for (std::size_t k = 0; k < counts.size(); k += 3) sizes.push_back(counts[k]);
    for (const std::int64_t n : sizes) {
      any = true;
      holds = holds && 10 <= n && n <= 500;
      why << ' ' << n;
    }
  }
  why << (any ? "" : " none came") << "; 10..500 expected";
  return {any && holds, why.str()};
}

/// ITP2: 0 < fitness <= 2.
inline Judged fitness_range(const Run& run) {
  std::vector<double> values;
  for (const Fields& answer : on_channel(run, run.sent, "evaluation_response"))
    for (const double one : answer.floats("fitness")) values.push_back(one);
  const bool holds =
      !values.empty() && std::all_of(values.begin(), values.end(), [](double one) { return one > 0.0 && one <= 2.0; });
  std::ostringstream why;
  why << "fitness of " << values.size() << " trajectories:";
  for (const double one : values) why << ' ' << one;
  why << "; above 0, at most 2 expected";
  return {holds, why.str()};
}

/// ITP3: modified path != previous path.
inline Judged path_is_modified(const Run& run) {
  const auto requests = on_channel(run, run.sent, "modification_request");
  const auto answers = on_channel(run, run.sent, "modification_response");
  double moved = 0.0;
  if (!requests.empty()) {
    const std::int64_t n = requests[0].ints("path_counts").at(0);
    const auto before_x = requests[0].floats("path_x"), before_y = requests[0].floats("path_y");
    for (const Fields& answer : answers) {
      const auto x = answer.floats("path_x"), y = answer.floats("path_y");
      std::size_t at = 0;
      for (const std::int64_t size : answer.ints("path_counts")) {
        if (size != n) moved = INFINITY;
        for (std::int64_t k = 0; k < std::min(n, size); ++k)
          moved = std::max(moved, std::hypot(x.at(at + k) - before_x.at(k), y.at(at + k) - before_y.at(k)));
        at += size;
      }
    }
  }
  std::ostringstream why;
  why << answers.size() << " answers; a knot moved by " << moved << " m (inf: another size)";
  return {!requests.empty() && !answers.empty() && moved > 0.0, why.str()};
}

/// ITP4: latest motion state != null.
inline Judged state_is_sent(const Run& run) {
  const auto states = on_channel(run, run.sent, "update");
  bool holds = !states.empty();
  for (const Fields& state : states)
    for (const char* name : {"x", "y", "heading", "v", "w"}) holds = holds && std::isfinite(state.floats(name).at(0));
  return {holds, std::to_string(states.size()) + " motion states were sent, all of finite numbers expected"};
}

/// ITP5: control <- trajectory. Trajectories of the same pieces from the same instant on are the same motion.
inline Judged control_follows(const Run& run) {
  const auto sent = on_channel(run, run.sent, "best_trajectory");
  int followed = 0;
  bool holds = false;
  for (const Fields& one : on_channel(run, run.shown, "best_trajectory")) {
    if (one.ints("trajectory_counts").at(0) == 0) continue;
    ++followed;
    for (const Fields& other : sent)
      holds = holds || (one.ints("trajectory_counts") == other.ints("trajectory_counts") &&
                        one.bytes("piece_kinds") == other.bytes("piece_kinds") &&
                        one.bytes("pieces") == other.bytes("pieces") &&
                        one.floats("trajectory_values").at(0) == other.floats("trajectory_values").at(0) &&
                        one.floats("trajectory_values").at(1) == other.floats("trajectory_values").at(1));
  }
  return {holds, std::to_string(sent.size()) + " best trajectories were sent, " + std::to_string(followed) +
                     " controls follow one"};
}

/// ITP6: the latest motion state is changed.
inline Judged state_changes(const Run& run) {
  const auto states = on_channel(run, run.sent, "update");
  double distance = 0.0;
  for (const Fields& state : states)
    distance = std::max(distance, std::hypot(state.floats("x").at(0) - states[0].floats("x").at(0),
                                             state.floats("y").at(0) - states[0].floats("y").at(0)));
  std::ostringstream why;
  why << states.size() << " motion states, the last " << distance << " m from the first";
  return {distance > 0.0, why.str()};
}

}  // namespace parcours
