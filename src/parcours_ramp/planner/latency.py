"""How long the planner's work takes: log-normal durations fitted to the published logs, drawn from a seeded stream.

Medians and 95th percentiles are those of the durations in the public recordings of the published system, of the paper's
version ([S]); transport between processes was not measured there and is assumed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from parcours.elementary import log
from parcours.errors import BadRequest
from parcours.kernels import Record, kernel
from parcours.streams import Stream, lognormal, start, uniform
from parcours_ramp.planner.messages import fields

_LONGEST = {"transport": 0.2, "added_sensing": 5.0, "added_planning": 5.0, "added_stop": 5.0}
"""The most that these may take [s]: a trajectory must arrive before the next one, a channel keeps 6 s of flags."""

_NORMAL_95 = 1.6448536269514722
_LATE_START = np.uint64(4)  # Purpose of the random stream of the first trajectory


@dataclass(frozen=True, slots=True)
class Duration:
    """A log-normal duration by its median and 95th percentile [s]."""

    median: float
    p95: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.median <= self.p95 < 1e6:
            raise BadRequest(
                "latency", f"a duration needs 0 <= median <= p95 in seconds, but has {self.median} and {self.p95}",
                slug="latency-range",
            )  # fmt: skip

    @property
    def spread(self) -> float:
        """The standard deviation of the logarithm."""
        return log(self.p95 / self.median) / _NORMAL_95 if self.median > 0.0 else 0.0


@dataclass(frozen=True, slots=True)
class Latencies:
    """What takes time in a run. The default is the published system's; `none()` is an infinitely fast machine."""

    planning: Duration = Duration(0.034, 0.100)  # one planning cycle [S]
    control: Duration = Duration(0.120, 0.180)  # one control cycle [S]
    sensing: Duration = Duration(0.012, 0.061)  # one sensing callback [S]
    guard: Duration = Duration(0.002, 0.005)  # one check of the guard as a task of its own; assumed
    transport: float = 0.001  # one message between processes [s]; assumed
    added_sensing: float = 0.0  # an obstacle message is so much older when it arrives [s]
    added_planning: float = 0.0  # a planning or control cycle takes so much longer [s]
    added_stop: float = 0.0  # a halt, or a limit of speed, reaches control so much later [s]

    def __post_init__(self) -> None:
        for name in _LONGEST:
            value = getattr(self, name)
            if not 0.0 <= value <= _LONGEST[name]:
                rule = f"it must be from 0 to {_LONGEST[name]:g} s, but {name} is {value}"
                raise BadRequest("latency", rule, slug="latency-range")

    def record(self) -> Record:
        """Return the latencies as a record of dtype LATENCIES."""
        record = np.zeros(1, LATENCIES).view(np.recarray)[0]
        for name in ("planning", "control", "sensing", "guard"):
            duration: Duration = getattr(self, name)
            record[name], record[name + "_spread"] = duration.median, duration.spread
        for name in _LONGEST:
            record[name] = round(getattr(self, name) * 1e9)
        return record


def none() -> Latencies:
    """Return latencies of zero."""
    zero = Duration(0.0, 0.0)
    return Latencies(zero, zero, zero, zero, 0.0)


LATENCIES = np.dtype(
    [
        *fields(
            "f8", "planning planning_spread control control_spread sensing sensing_spread guard guard_spread"
        ),  # [s]
        *fields("i8", "transport added_sensing added_planning added_stop"),  # [ns]
    ]
)  # The layout of `Latencies.record()`


@kernel
def late_start(stream: Stream, seed: np.uint64, case: np.uint64) -> int:
    """Return when control gets its first trajectory in the published harness [ns]; `stream` is working memory.

    0.42, 0.64 and 0.80 s are the 5th, 50th and 95th percentile of 144 recordings; in between and beyond it is linear.
    """
    start(stream, seed, case, _LATE_START)
    share = uniform(stream)
    return int((0.64 + (share - 0.5) / 0.45 * (0.22 if share < 0.5 else 0.16)) * 1e9)


@kernel
def draw(stream: Stream, median: float, spread: float) -> int:
    """Return the next duration [ns]; 0 draws nothing."""
    if median <= 0.0:
        return 0
    return int(lognormal(stream, median, spread) * 1e9)
