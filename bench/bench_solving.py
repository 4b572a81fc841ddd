"""What it costs to decide whether a path can run, against its length: one solver that walks along, or one a path.

python bench/bench_solving.py              paths of 10 to 300 transitions
python bench/bench_solving.py --longest 1000
"""

from __future__ import annotations

import argparse
import time

from parcours.model import parse_model
from parcours.model.structure import Cefsm
from parcours.paths.solving.reading import ModelTables
from parcours.paths.solving.walk import SymbolicWalk
from parcours.paths.timing import schedule
from parcours.paths.timing.events import TimedEvent, events_of

COUNTER = """
parcours: model/1
name: counter
components:
  C:
    variables:
      n: {type: int, initial: 0}
      m: {type: int, initial: 0}
      total: {type: int, initial: 0}
      k: {type: int, role: input, range: [0, 9]}
    machines:
      m:
        initial: a
        transitions:
          t1: {from: a, to: b, guard: n + k < 10000, action: n := n + k}
          t2: {from: b, to: a, guard: m <= n, action: "m := m + k; total := n + m"}
"""
TIMED = (
    COUNTER.replace("range: [0, 9]}", "range: [0, 9]}\n      x: {type: clock}")
    .replace("guard: m <= n,", "guard: m <= n && x >= 1 && x < 5, duration: [0.5, 4],")
    .replace("m := m + k;", "x := 0; m := m + k;")
)
"""Three integer variables and one input a step; and the same with a clock and a duration."""


def events(cefsm: Cefsm, length: int) -> tuple[TimedEvent, ...]:
    """Return a path of some length, round and round."""
    return events_of(cefsm, [("t1", "t2")[place % 2] for place in range(length)])


def incremental(cefsm: Cefsm, length: int) -> float:
    """Return how long it takes to ask after each transition of one path whether it can run so far [s]."""
    begun = time.perf_counter()
    walk = SymbolicWalk(ModelTables(cefsm), [(0, "C", "m")])
    for event in events(cefsm, length):
        walk.push(event)
        assert walk.check(60_000)
    return time.perf_counter() - begun


def fresh(cefsm: Cefsm, length: int) -> float:
    """Return how long it takes to ask once about the whole path, by a new solver [s]."""
    begun = time.perf_counter()
    walk = SymbolicWalk(ModelTables(cefsm), [(0, "C", "m")])
    for event in events(cefsm, length):
        walk.push(event)
    assert walk.check(60_000)
    return time.perf_counter() - begun


def scheduled(cefsm: Cefsm, length: int) -> float:
    """Return how long the temporal network of a path takes [s]."""
    begun = time.perf_counter()
    schedule(cefsm, [event.transition.id for event in events(cefsm, length)])
    return time.perf_counter() - begun


def main() -> None:
    """Print a line for each length: all prefixes along one solver, all prefixes each by its own, and the ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--longest", type=int, default=300, help="longest path")
    chosen = parser.parse_args()
    if chosen.longest < 10:
        parser.error(f"--longest must be at least 10, but is {chosen.longest}")
    lengths = [length for length in (10, 30, 100, 300, 1000) if length <= chosen.longest]
    for what, text in (("data", COUNTER), ("data and time", TIMED)):
        cefsm = parse_model(text)
        fresh(cefsm, 10)  # the solver's library is loaded
        print(f"{what}:")
        for length in lengths:
            along, once = incremental(cefsm, length), fresh(cefsm, length)
            # Asking about every prefix afresh takes about the mean of the first and the last, so often.
            every = length * once / 2
            line = (
                f"  {length:>4} transitions: along {1e3 * along / length:5.2f} ms a prefix, afresh {1e3 * once:.0f} ms;"
                f" all along {along:.2f} s, afresh about {every:.2f} s, ratio {every / along:.0f}"
            )
            if cefsm.component("C").variables[-1].type == "clock":
                line += f"; windows {scheduled(cefsm, length):.2f} s"
            print(line)


if __name__ == "__main__":
    main()
