"""What real time costs: RAMP's interactions in this process and on processes, and the relay of a live system case.

python bench/bench_hosts.py --repeats 20 --seconds 5

Durations are from the first to the last event of the paper's 60 component cases: `here` all instances in this process,
`strict` on nodes of their own in the serialised order itself, `concurrent` in any order that the case leaves open. The
relay's latency is from the moment a message leaves its sender to the moment its receiver takes it up, through the
tester, over all messages between two nodes of a running system; a receiver that is busy adds its own time.
"""

from __future__ import annotations

import argparse
import gc
import os
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from parcours.run.clocks import WallClock
from parcours.run.hosts.scheduling import real_time
from parcours.run.trace import Trace
from parcours.study.hosting import started
from parcours_ramp.components.study import (
    CASES_OF_PAPER,
    Execute,
    component_nodes,
    component_plan,
    duration_of,
    here,
    interaction_of,
    on,
    paper_sample,
)
from parcours_ramp.planner.component_factory import COMPONENTS
from parcours_ramp.system.live import run_live
from parcours_ramp.system.live_running import system_nodes
from parcours_ramp.system.study import system_study

WARM_UP = 2


def figures(times: Sequence[float]) -> str:
    """Return p50, p95, p99 and the greatest [ms]."""
    return " ".join(f"{value:8.2f}" for value in np.percentile(np.array(times) * 1e-6, [50, 95, 99, 100]))


def durations(execute: Execute, repeats: int) -> dict[str, list[int]]:
    """Return the durations of each interaction path [ns]."""
    taken: dict[str, list[int]] = {itp: [] for itp in CASES_OF_PAPER}
    for repeat in range(WARM_UP + repeats):
        for case in paper_sample(component_plan(0)):
            one = duration_of(execute(case).trace)
            if repeat >= WARM_UP:
                taken[interaction_of(case)].append(one)
    return taken


def components(repeats: int) -> None:
    with started(component_nodes(), "processes") as hosted:
        nodes = hosted.transport, hosted.codec
        executes = {"here": here(WallClock), "strict": on(*nodes), "concurrent": on(*nodes, strict=False)}
        results = {name: durations(execute, repeats) for name, execute in executes.items()}
    print(f"{'interaction':<12}{'':<12}{'p50':>8} {'p95':>8} {'p99':>8} {'max':>8}  [ms]  p50, times here")
    for itp in CASES_OF_PAPER:
        first = float(np.median(results["here"][itp]))
        for name, result in results.items():
            ratio = float(np.median(result[itp])) / first
            print(f"{itp:<12}{name:<12}{figures(result[itp])}        {ratio:.1f}")


def relayed(trace: Trace) -> list[int]:
    """Return how long each message between two nodes was on its way [ns]."""
    sent = {
        event.message: event.time for event in trace.events if event.kind == "send" and event.component in COMPONENTS
    }
    return [
        event.time - sent[event.message]
        for event in trace.events
        if event.kind == "receive" and event.component in COMPONENTS and event.message in sent
    ]


def system(seconds: float) -> None:
    study = replace(system_study("guarded", seed=1), time_limit=seconds)
    with started(system_nodes(), "processes") as hosted:
        nodes = hosted.transport, hosted.codec
        run_live(replace(study, time_limit=1.0), 0, *nodes)
        for what, listener in (("not recorded", None), ("recorded", lambda event: None)):
            trace = run_live(study, 0, *nodes, listener=listener).trace
            n, lasted = sum(event.kind == "send" for event in trace.events), trace.events[-1].time * 1e-9
            print(f"system case, {what:<13}{n / lasted:6.0f} messages/s; node to node {figures(relayed(trace))}  [ms]")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=5.0)
    given = parser.parse_args()
    with real_time() as rule:
        print(f"{rule}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, {given.repeats} repeats")
        gc.collect()
        components(given.repeats)
        system(given.seconds)


if __name__ == "__main__":
    main()
