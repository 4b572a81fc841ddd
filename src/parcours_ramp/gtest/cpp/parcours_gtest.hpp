// Cases, repeats and limits -> verdicts of Google Test: pass, failure, or skip where neither can be said.
#pragma once

#include <sched.h>

#include <gtest/gtest.h>

#include "parcours_oracles.hpp"
#include "parcours_timing.hpp"

namespace parcours {

/// The graph of the nodes under test, from the first test to the end of all: roscpp is started once in a process.
class Live : public testing::Environment {
 public:
  Live(const Channel* channels, int n_channels, std::vector<std::string> components)
      : channels_(channels), n_channels_(n_channels), components_(std::move(components)) {
    instance_ = this;
  }
  void SetUp() override {
    if (graph_) return;
    try {
      graph_ = std::make_unique<Graph>(channels_, n_channels_, components_);
    } catch (const HostError& error) {
      FAIL() << error.what();
    }
  }

  static Graph& graph() {
    if (!instance_ || !instance_->graph_) throw HostError("there is no graph");
    return *instance_->graph_;
  }
  static void leave() { instance_->graph_.reset(); }
  static NoiseMeter& noise() { return instance_->noise_; }

 private:
  inline static Live* instance_ = nullptr;
  const Channel* channels_;
  int n_channels_;
  std::vector<std::string> components_;
  NoiseMeter noise_;
  std::unique_ptr<Graph> graph_;
};

/// Execute a case once, in its serialised order, and judge it.
inline void run_functional(const Case& one) {
  testing::Test::RecordProperty("case", one.id);
  Run run;
  Judged judged;
  try {
    run = Enforcement(Live::graph(), one, true).run();
    if (run.deviation.empty()) judged = one.oracle(run);
  } catch (const std::exception& error) {
    FAIL() << "host: " << error.what();
  }
  if (!run.deviation.empty()) FAIL() << run.deviation;
  if (!run.disorder.empty()) GTEST_SKIP() << run.disorder;
  EXPECT_TRUE(judged.first) << judged.second;
}

inline std::string listed(const std::vector<std::int64_t>& numbers) {
  std::string text;
  for (const std::int64_t one : numbers) text += (text.empty() ? "" : " ") + std::to_string(one);
  return text;
}

/// Execute a case again and again, and judge its durations as `parcours run` does.
inline void run_timing(const Case& one, const Limit& limit) {
  testing::Test::RecordProperty("case", one.id);
  testing::Test::RecordProperty("bound", limit.bound);
  std::vector<std::int64_t> times, noise;
  try {
    for (int k = -limit.warm_up; k < limit.repeats; ++k) {
      const Run run = Enforcement(Live::graph(), one, false).run();
      if (k < 0) continue;
      times.push_back(run.duration());
      const Until begin = Steady::now();
      for (int sample = 0; sample < limit.noise_samples; ++sample) noise.push_back(Live::noise().sample(limit.trips));
      // The system stops real-time threads for 50 ms that leave ordinary ones less than 5 % of a second.
      std::this_thread::sleep_for((Steady::now() - begin) / 2);
    }
  } catch (const std::exception& error) {
    FAIL() << "host: " << error.what();
  }
  testing::Test::RecordProperty("durations_ns", listed(times));
  testing::Test::RecordProperty("noise_ns", listed(noise));
  std::sort(times.begin(), times.end());
  std::sort(noise.begin(), noise.end());
  const auto ranked = [&](std::size_t percent) { return times[(percent * times.size() + 99) / 100 - 1]; };
  for (const int percent : {50, 95, 99})
    testing::Test::RecordProperty("p" + std::to_string(percent) + "_ns", std::to_string(ranked(percent)));
  testing::Test::RecordProperty("max_ns", std::to_string(times.back()));
  const TimeVerdict judged = time_verdict(times, noise, limit);
  if (judged.verdict == Verdict::inconclusive) GTEST_SKIP() << judged.why;
  EXPECT_TRUE(judged.verdict == Verdict::pass) << judged.why;
}

/// Run all tests; `nodes` are the components whose nodes are waited for.
inline int run_all(int argc, char** argv, const Channel* channels, int n_channels, std::vector<std::string> nodes) {
  testing::InitGoogleTest(&argc, argv);
  sched_param priority{};
  priority.sched_priority = 10;  // as the nodes, where the system allows it
  sched_setscheduler(0, SCHED_FIFO, &priority);
  testing::AddGlobalTestEnvironment(new Live(channels, n_channels, std::move(nodes)));
  ros::init(argc, argv, TESTER + 1, ros::init_options::NoRosout);
  ros::console::set_logger_level("ros.roscpp", ros::console::levels::Fatal);  // calls that nobody answers are meant
  const int failed = RUN_ALL_TESTS();
  Live::leave();
  return failed;
}

}  // namespace parcours
