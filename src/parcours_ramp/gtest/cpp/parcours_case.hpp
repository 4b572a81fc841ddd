// What a case is, as the tables of test_cases.cpp say it, and what came of it.
#pragma once

#include <algorithm>
#include <string_view>
#include <utility>

#include "parcours_ends.hpp"

namespace parcours {

constexpr int NONE = -1;

/// One transition of a serialised case. Places of channels and positions of events are NONE where there is none.
struct Event {
  int position, reference;
  const char *component, *transition;
  int receives, source;       // a channel, and the event that sends; without one the environment does
  int sends;                  // a channel
  bool to_reference;          // whether what is sent waits in a gate for another event
  int after[2], before;       // events before this one; this one is before that event
  const char* prompt;         // what moves an idle component to it, where no message does
};

enum class Use { supply, given, settle };  // received from the environment; instead of a prompt; taken up before

/// A message that the tester makes up for an event.
struct Stimulus {
  int position;
  Use use;
  const char* channel;
  std::string_view data;
};

struct Run;
/// The expected result: whether it came, and in words what came.
using Oracle = std::pair<bool, std::string> (*)(const Run&);

struct Case {
  const char* id;
  std::string_view document;  // as the nodes know it
  const Event* events;
  int n_events;
  const Stimulus* stimuli;
  int n_stimuli;
  Oracle oracle;
};

/// What came of a case. Of the messages, only those that components sent.
struct Run {
  const Channel* channels;
  std::string deviation, disorder;
  std::vector<Message> sent, shown;
  std::int64_t first = NEVER, last = 0;  // stamps [ns]

  void stamp(std::int64_t time) {
    first = std::min(first, time);
    last = std::max(last, time);
  }
  std::int64_t duration() const { return deviation.empty() ? last - first : NEVER; }
};

inline std::string instance_name(const Event& event) {
  return std::string(event.component) + "#" + std::to_string(event.reference);
}

}  // namespace parcours
