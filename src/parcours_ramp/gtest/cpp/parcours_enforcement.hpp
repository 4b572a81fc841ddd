// A serialised abstract case and live nodes -> what came of it, or the first deviation.
//
// Each reference of a case runs in an instance of its own, in its component's node. A message between references is held
// in a gate from when it is sent until the event that receives it has its turn. Every transition taken, and the channels
// it sends on, are compared with what the case demands; the first deviation ends the case.
#pragma once

#include "parcours_case.hpp"
#include "parcours_graph.hpp"

namespace parcours {

/// The execution of one case.
class Enforcement {
 public:
  /// `strict` keeps the serialised order itself; else any order that the case leaves open.
  Enforcement(Graph& graph, const Case& one, bool strict) : graph_(graph), case_(one), strict_(strict) {
    run_.channels = &graph.channel(0);
    for (int k = 0; k < one.n_events; ++k) {
      to_do_[one.events[k].reference].push_back(&one.events[k]);
      instances_[one.events[k].reference] = one.events[k].component;
    }
    done_.assign(one.n_events, NEVER);
  }

  /// Throws HostError if the nodes cannot go on.
  Run run() {
    begin();
    try {
      while (n_done_ < case_.n_events) {
        grant();
        listen();
      }
    } catch (const Deviated& found) {
      run_.deviation = told(found);
    }
    if (run_.deviation.empty()) look();
    rest();
    if (run_.deviation.empty()) find_disorder();
    return run_;
  }

 private:
  struct Deviated {
    const Event* event;
    std::string expected, got;
  };
  struct Gate {
    int source, channel;
    std::deque<std::string> messages;
  };
  std::int64_t now() const { return steady_ns() - zero_; }

  void begin() {
    std::map<std::string, std::vector<int>> references;
    for (const auto& [reference, name] : instances_) references[name].push_back(reference);
    zero_ = steady_ns();
    for (const auto& [name, mine] : references) {
      nodes_.insert(name);
      if (!graph_.lives(name)) throw HostError("node " + name + ": must live as long as the tester, but has ended");
      Packer frame;
      frame.array(4).text("Begin").bytes(case_.document).array(mine.size());
      for (int reference : mine) frame.integer(reference);
      graph_.command(name, frame.integer(zero_));
    }
    await("Ready", nodes_, 10.0, true);
  }

  void await(const char* kind, std::set<std::string> waiting, double within, bool needed) {
    const Until until = after_seconds(within);
    while (!waiting.empty()) {
      const auto report = graph_.poll(until);
      if (!report) {
        std::string names;
        for (const std::string& name : waiting) names += " " + name;
        throw HostError("nodes must answer within " + std::to_string(static_cast<int>(within)) + " s, but silent are:" + names);
      }
      if (report->kind == "Died" && needed && waiting.count(report->node)) throw HostError("node " + report->node + " has ended");
      if (report->kind == kind || report->kind == "Died") waiting.erase(report->node);
    }
  }

  /// Grant every instance that has nothing under way as many turns as it may take now.
  void grant() {
    for (auto& [reference, to_do] : to_do_) {
      auto& granted = granted_[reference];
      if (!granted.empty()) continue;
      std::vector<const Event*> turns;
      while (!to_do.empty() && is_due(*to_do.front(), turns)) {
        turns.push_back(to_do.front());
        to_do.pop_front();
      }
      if (turns.empty()) continue;
      Packer frame;
      frame.array(3).text("Grant").integer(reference).array(turns.size());
      for (const Event* event : turns) {
        granted.push_back(event);
        pack(frame, *event, event->receives == NONE ? -1 : handed(*event));
      }
      graph_.command(turns.front()->component, frame);
    }
  }

  bool is_due(const Event& event, const std::vector<const Event*>& ahead) const {
    if (strict_) return event.position == n_done_ + static_cast<int>(ahead.size());
    const auto is_ahead = [&](int position) {
      return std::any_of(ahead.begin(), ahead.end(), [&](const Event* one) { return one->position == position; });
    };
    for (int one : event.after)
      if (one != NONE && done_[one] == NEVER && !is_ahead(one)) return false;
    for (int k = 0; k < case_.n_events; ++k)
      if (case_.events[k].before == event.position && done_[k] == NEVER) return false;
    return event.receives == NONE || !graph_.is_busy(event.receives);
  }

  /// Open the gate of the message that the event receives, deliver it, and return its number.
  int handed(const Event& event) {
    std::string payload;
    if (event.source == NONE) {
      payload = std::string(stimulus(event.position, Use::supply)->data);
    } else {
      const auto gate = std::find_if(gates_.begin(), gates_.end(), [&](const Gate& one) {
        return one.source == event.source && one.channel == event.receives && !one.messages.empty();
      });
      if (gate == gates_.end())
        throw Deviated{&event, std::string(event.transition) + " on receiving " + graph_.channel(event.receives).name,
                       "no message from event " + std::to_string(event.source)};
      payload = std::move(gate->messages.front());
      gate->messages.pop_front();
    }
    run_.stamp(now());
    graph_.deliver(event.receives, n_delivered_, payload);
    return n_delivered_++;
  }

  const Stimulus* stimulus(int position, Use use) const {
    for (int k = 0; k < case_.n_stimuli; ++k)
      if (case_.stimuli[k].position == position && case_.stimuli[k].use == use) return &case_.stimuli[k];
    return nullptr;
  }

  static void pack(Packer& frame, const Stimulus& one) { frame.array(2).text(one.channel).bytes(one.data); }

  void pack(Packer& frame, const Event& event, int awaits) const {
    frame.array(5).text(event.transition).integer(awaits).text(awaits < 0 ? event.prompt : "");
    const Stimulus* given = awaits < 0 ? stimulus(event.position, Use::given) : nullptr;
    if (given) pack(frame, *given); else frame.nil();
    std::vector<const Stimulus*> settling;
    for (int k = 0; k < case_.n_stimuli; ++k)
      if (case_.stimuli[k].position == event.position && case_.stimuli[k].use == Use::settle)
        settling.push_back(&case_.stimuli[k]);
    frame.array(settling.size());
    for (const Stimulus* one : settling) pack(frame, *one);
  }

  void listen() {
    const double patience = 5.0;
    const Until until = after_seconds(patience);
    while (true) {
      const auto report = graph_.poll(until);
      if (!report) {
        for (const auto& [reference, granted] : granted_)
          if (!granted.empty())
            throw Deviated{granted.front(), granted.front()->transition, "nothing within 5 s"};
        throw HostError("no event of the case can go on");
      }
      if (report->kind == "Died") {
        for (auto& [reference, granted] : granted_)
          if (!granted.empty() && granted.front()->component == report->node)
            throw Deviated{granted.front(), granted.front()->transition, "its process ended"};
      } else if (report->kind == "Turned" && !granted_[report->reference].empty()) {
        const Event* event = granted_[report->reference].front();
        granted_[report->reference].pop_front();
        judge(*event, *report);
        return;
      }
    }
  }

  void judge(const Event& event, const Report& outcome) {
    const std::string transition = event.transition;
    for (const auto& [time, message] : outcome.asides) {
      run_.stamp(time);
      run_.sent.push_back(message);
    }
    if (outcome.received >= 0) run_.stamp(outcome.received);
    if (outcome.manner == "unasked")
      throw Deviated{&event, transition + " on receiving " + graph_.channel(event.receives).name, "it unasked"};
    if (outcome.manner != "taken")
      throw Deviated{&event, transition, outcome.text.empty() ? "no transition" : outcome.text};
    if (outcome.transition != transition) throw Deviated{&event, transition, outcome.transition};
    run_.stamp(outcome.time);
    std::vector<std::string> names;
    for (const Message& message : outcome.sends) {
      names.push_back(message.name);
      run_.sent.push_back(message);
      if (!event.to_reference || message.channel != event.sends) continue;
      const auto gate = std::find_if(gates_.begin(), gates_.end(), [&](const Gate& one) {
        return one.source == event.position && one.channel == message.channel;
      });
      if (gate == gates_.end()) gates_.push_back({event.position, message.channel, {message.data}});
      else gate->messages.push_back(message.data);
    }
    std::vector<std::string> demanded;
    if (event.sends != NONE) demanded.push_back(graph_.channel(event.sends).name);
    if (names != demanded)
      throw Deviated{&event, transition + " to send " + listed(demanded), transition + " sending " + listed(names)};
    paths_[event.reference] += (paths_[event.reference].empty() ? "" : " ") + transition;
    done_[event.position] = outcome.time;
    ++n_done_;
  }

  static std::string listed(std::vector<std::string> names) {
    std::sort(names.begin(), names.end());
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
    return text.empty() ? "nothing" : text;
  }

  std::string told(const Deviated& found) {
    std::string held;
    for (const Gate& gate : gates_)
      for (std::size_t k = 0; k < gate.messages.size(); ++k)
        held += (held.empty() ? "" : ", ") + std::string(graph_.channel(gate.channel).name) + " from event " +
                std::to_string(gate.source);
    const std::string& path = paths_[found.event->reference];
    return "event " + std::to_string(found.event->position) + ", " + instance_name(*found.event) + ": expected " +
           found.expected + ", got " + found.got + ", after " + (path.empty() ? "its start" : path) +
           "; held back: " + (held.empty() ? "nothing" : held);
  }

  void look() {
    for (const auto& [reference, name] : instances_) {
      Packer frame;
      graph_.command(name, frame.array(2).text("Look").integer(reference));
    }
    const Until until = after_seconds(10.0);
    for (std::size_t waiting = instances_.size(); waiting > 0;) {
      const auto report = graph_.poll(until);
      if (!report || report->kind == "Died") throw HostError("a node must show what it did within 10 s, but does not");
      if (report->kind != "ViewShown") continue;
      --waiting;
      run_.shown.insert(run_.shown.end(), report->sends.begin(), report->sends.end());
    }
  }

  /// Let the nodes forget the case: what is still under way of it is not heard any more.
  void rest() {
    std::set<std::string> waiting;
    for (const std::string& name : nodes_)
      if (graph_.lives(name)) {
        waiting.insert(name);
        Packer frame;
        graph_.command(name, frame.array(1).text("Rest"));
      }
    await("Ready", waiting, 3.0, false);
  }

  void find_disorder() {
    for (int k = 0; k < case_.n_events; ++k) {
      const Event& event = case_.events[k];
      for (int one : event.after) compare(one, event.position);
      if (event.before != NONE) compare(event.position, event.before);
    }
  }

  void compare(int first, int second) {
    if (first == NONE || !run_.disorder.empty() || done_[first] <= done_[second]) return;
    run_.disorder = "order not enforced: event " + std::to_string(first) + " must come before event " +
                    std::to_string(second) + ", but came " + std::to_string(done_[first] - done_[second]) + " ns after it";
  }

  Graph& graph_;
  const Case& case_;
  const bool strict_;
  Run run_;
  std::int64_t zero_ = 0;
  std::set<std::string> nodes_;
  std::map<int, std::string> instances_;
  std::map<int, std::deque<const Event*>> to_do_;
  std::map<int, std::deque<const Event*>> granted_;
  std::map<int, std::string> paths_;
  std::vector<Gate> gates_;
  std::vector<std::int64_t> done_;
  int n_done_ = 0, n_delivered_ = 0;
};

}  // namespace parcours
