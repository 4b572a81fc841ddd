// Durations of repeats, a limit and the noise beside them -> pass, fail, or why neither can be said.
#pragma once

#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <sstream>
#include <vector>

#include "parcours_clock.hpp"
#include "parcours_frames.hpp"

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

enum class Verdict { pass, fail, inconclusive };

struct TimeVerdict {
  Verdict verdict;
  std::string why;
};

inline std::string shown(std::int64_t time) {
  if (time == NEVER) return "never";
  std::ostringstream text;
  text << static_cast<double>(time) * 1e-6 << " ms";
  return text.str();
}

/// The rule of `parcours run`, whose ranks the limit holds; durations and noise [ns] in order of size.
inline TimeVerdict time_verdict(const std::vector<std::int64_t>& times, const std::vector<std::int64_t>& noise,
                                const Limit& limit) {
  const int n = times.size(), n_noise = noise.size();
  const int kept = std::upper_bound(times.begin(), times.end(), std::min(limit.limit, NEVER - 1)) - times.begin();
  std::ostringstream said;
  said << limit.bound << ": " << n - kept << " of " << n << " repeats missed it; ";
  const auto refused = [&](const char* why, const char* slug) {
    return TimeVerdict{Verdict::inconclusive, said.str() + why + " [" + slug + "]"};
  };
  const auto is_noisy = [&](int rank, std::int64_t margin) {
    return margin < 0 || rank > n_noise || noise[rank - 1] > margin;
  };
  if (limit.high <= kept) {
    const std::int64_t upper = times[limit.high - 1];
    said << "its quantile is at most " << shown(upper);
    if (is_noisy(limit.noise_pass, limit.limit - upper)) return refused(", which is within the noise", "noise");
    return {Verdict::pass, said.str()};
  }
  if (limit.low > kept) {
    said << "its quantile is at least " << shown(times[limit.low - 1]);
    const std::int64_t margin = limit.charged > 0 ? times[limit.charged - 1] - limit.limit - 1 : -1;
    if (is_noisy(limit.noise_fail, margin)) return refused(", but noise may have done it", "noise");
    return {Verdict::fail, said.str()};
  }
  return kept == n ? refused("too few repeats to tell", "few-repeats") : refused("too close to tell", "undecided");
}

}  // namespace parcours
