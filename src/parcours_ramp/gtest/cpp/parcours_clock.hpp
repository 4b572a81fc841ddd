// The machine's monotonic clock, which all its processes read alike.
#pragma once

#include <chrono>
#include <cstdint>

namespace parcours {

using Steady = std::chrono::steady_clock;
using Until = Steady::time_point;

constexpr std::int64_t NEVER = INT64_MAX;  // of a repeat that deviated, how long it took [ns]

inline std::int64_t steady_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(Steady::now().time_since_epoch()).count();
}

inline Until after_seconds(double seconds) {
  return Steady::now() + std::chrono::duration_cast<Steady::duration>(std::chrono::duration<double>(seconds));
}

}  // namespace parcours
