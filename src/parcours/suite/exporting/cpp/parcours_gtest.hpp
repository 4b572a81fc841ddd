// Cases, repeats and limits -> verdicts of Google Test: pass, failure, or skip where neither can be said.
#pragma once

#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <sched.h>

#include <gtest/gtest.h>

#include "parcours_oracles.hpp"

namespace parcours {

/// The injected upper limit of a timing case, and which ranks of its repeats bound its quantile.
struct Limit {
  const char* bound;      // in words
  std::int64_t limit;     // [ns]
  double percent;         // so many of all repeats must stay within it
  int repeats, warm_up;
  int low, high;          // the repeats of these ranks, counted from 1, bound the quantile from below and from above
  int charged;            // the same from below, if some misses are put down to noise; 0 if none does
  int noise_samples;      // after each repeat
  int noise_pass, noise_fail;  // the ranks of noise that must lie within the margin of a pass, of a failure
  int trips;              // round trips in a sample of noise
};

/// An empty loop beside the repeats: round trips to a bare process, then work of the processor of which only what was
/// lost counts. Begins before the graph does, so that the bare process holds nothing of it.
class NoiseMeter {
 public:
  NoiseMeter() {
    int line[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, line) != 0) throw HostError("noise meter: no socket pair");
    if (fork() == 0) {
      close(line[0]);
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      char byte;
      while (read(line[1], &byte, 1) == 1 && write(line[1], &byte, 1) == 1) {
      }
      _exit(0);
    }
    close(line[1]);
    line_ = line[0];
  }
  std::int64_t sample(int trips) {
    const std::int64_t begin = steady_ns();
    char byte = '.';
    for (int k = 0; k < trips; ++k)
      if (write(line_, &byte, 1) != 1 || read(line_, &byte, 1) != 1) throw HostError("noise meter: its process has ended");
    std::int64_t noise = steady_ns() - begin, done = 0, last = steady_ns();
    while (done < 1000000) {
      const std::int64_t time = steady_ns(), gap = time - last;
      last = time;
      (gap > 2000 ? noise : done) += gap;
    }
    return noise;
  }

 private:
  int line_;
};

/// The graph of the nodes under test, while tests run.
class Live : public testing::Environment {
 public:
  Live(const Channel* channels, int n_channels, std::vector<std::string> components)
      : channels_(channels), n_channels_(n_channels), components_(std::move(components)) {
    instance_ = this;
  }
  void SetUp() override {
    try {
      graph_ = std::make_unique<Graph>(channels_, n_channels_, components_);
    } catch (const HostError& error) {
      FAIL() << error.what();
    }
  }
  void TearDown() override { graph_.reset(); }

  static Graph& graph() {
    if (!instance_ || !instance_->graph_) throw HostError("there is no graph");
    return *instance_->graph_;
  }
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

inline std::string shown(std::int64_t time) {
  if (time == NEVER) return "never";
  std::ostringstream text;
  text << static_cast<double>(time) * 1e-6 << " ms";
  return text.str();
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
      for (int sample = 0; sample < limit.noise_samples; ++sample) noise.push_back(Live::noise().sample(limit.trips));
    }
  } catch (const std::exception& error) {
    FAIL() << "host: " << error.what();
  }
  std::sort(times.begin(), times.end());
  std::sort(noise.begin(), noise.end());
  const int n = limit.repeats;
  const auto ranked = [&](int percent) { return times[std::max(1, (percent * n + 99) / 100) - 1]; };
  for (const int percent : {50, 95, 99})
    testing::Test::RecordProperty("p" + std::to_string(percent) + "_ns", std::to_string(ranked(percent)));
  testing::Test::RecordProperty("max_ns", std::to_string(times.back()));
  if (!noise.empty()) testing::Test::RecordProperty("noise_max_ns", std::to_string(noise.back()));
  const auto kept = std::upper_bound(times.begin(), times.end(), limit.limit) - times.begin();
  std::ostringstream said;
  said << limit.bound << ": " << n - kept << " of " << n << " repeats missed it; ";
  const auto too_noisy = [&](int rank, std::int64_t margin) {
    return margin < 0 || rank > static_cast<int>(noise.size()) || noise[rank - 1] > margin;
  };
  if (limit.high <= kept) {
    const std::int64_t upper = times[limit.high - 1];
    said << "its quantile is at most " << shown(upper);
    if (too_noisy(limit.noise_pass, limit.limit - upper)) GTEST_SKIP() << said.str() << ", within the noise [noise]";
    return;
  }
  if (limit.low > kept) {
    said << "its quantile is at least " << shown(times[limit.low - 1]);
    const std::int64_t margin = limit.charged > 0 ? times[limit.charged - 1] - limit.limit - 1 : -1;
    if (too_noisy(limit.noise_fail, margin)) GTEST_SKIP() << said.str() << ", but noise may have done it [noise]";
    FAIL() << said.str();
  }
  GTEST_SKIP() << said.str() << (kept == n ? "too few repeats to tell [few-repeats]" : "too close to tell [undecided]");
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
  return RUN_ALL_TESTS();
}

}  // namespace parcours
