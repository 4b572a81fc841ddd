"""How many configurations of a composition one core explores in a second, and what each of them costs in memory.

python bench/bench_space.py              four families of models, from 10^3 to 10^6 configurations
python bench/bench_space.py --largest 5  up to 10^5

Each line is a process of its own, so that its memory is its own. Rendezvous: philosophers who take the left fork
first, 3^n - 1 configurations. Variables: the same with forks as variables of one component. Queues: n pairs of a
producer and a consumer, ten fillings a queue, 10^n. Data: n counters in a ring that pass their value on in messages of
two fields and compare it, with queues of two. The search stops at 2 million configurations. Rates are per second of
processor time, findings included.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time

from parcours.model import Cefsm, parse_model
from parcours.model.composition import explore

SIZES = {
    "rendezvous": {3: 6, 4: 9, 5: 11, 6: 13},
    "variables": {3: 6, 4: 9, 5: 11, 6: 13},
    "queues": {3: 3, 4: 4, 5: 5, 6: 6},
    "data": {3: 2, 4: 3, 5: 4, 6: 5},
}
"""For each family and each decade of configurations, the parameter that comes next to it."""

_FORK = """
  Fork{n}:
    machines:
      m:
        initial: free
        transitions:
          f{n}1: {{from: free, to: left, event: l{n}}}
          f{n}2: {{from: left, to: free, event: l{n}}}
          f{n}3: {{from: free, to: right, event: r{n}}}
          f{n}4: {{from: right, to: free, event: r{n}}}"""

_PHILOSOPHER = """
  Philosopher{n}:
    machines:
      m:
        initial: thinks
        transitions:
          p{n}1: {{from: thinks, to: waits, message: l{n}}}
          p{n}2: {{from: waits, to: eats, message: r{next}}}
          p{n}3: {{from: eats, to: leaves, message: l{n}}}
          p{n}4: {{from: leaves, to: thinks, message: r{next}}}"""

_SHARING = """
      m{n}:
        initial: thinks
        transitions:
          p{n}1: {{from: thinks, to: waits, guard: f{n}, action: f{n} := false}}
          p{n}2: {{from: waits, to: eats, guard: f{next}, action: f{next} := false}}
          p{n}3: {{from: eats, to: leaves, action: f{n} := true}}
          p{n}4: {{from: leaves, to: thinks, action: f{next} := true}}"""

_PAIR = """
  Producer{n}: {{machines: {{m: {{initial: s, transitions: {{p{n}: {{from: s, to: s, message: q{n}}}}}}}}}}}
  Consumer{n}: {{machines: {{m: {{initial: s, transitions: {{c{n}: {{from: s, to: s, event: q{n}}}}}}}}}}}"""

_COUNTER = """
  Counter{n}:
    variables:
      k: {{type: int, initial: 0, range: [0, 1]}}
      last: {{type: int, initial: 0, range: [0, 1]}}
    machines:
      m:
        initial: s
        transitions:
          t{n}: {{from: s, to: s, message: "q{n}(k, last == k)", action: k := (k + 1) % 2}}
          u{n}: {{from: s, to: s, event: q{before}(m), guard: m.same || m.value != k, action: last := m.value}}
          v{n}: {{from: s, to: s, event: q{before}(m), guard: "!m.same && m.value == k"}}"""


def model(family: str, size: int) -> Cefsm:
    """Return the model of a family."""
    channels, components = "", ""
    if family == "variables":
        forks = ", ".join(f"f{n}: {{type: bool, initial: true}}" for n in range(size))
        components = f"\n  Table:\n    variables: {{{forks}}}\n    machines:"
    for n in range(size):
        before, following = (n - 1) % size, (n + 1) % size
        if family == "rendezvous":
            channels += f"\n  l{n}: {{from: Philosopher{n}, to: Fork{n}, message: M, capacity: 0}}"
            channels += f"\n  r{n}: {{from: Philosopher{before}, to: Fork{n}, message: M, capacity: 0}}"
            components += _FORK.format(n=n) + _PHILOSOPHER.format(n=n, next=following)
        elif family == "variables":
            components += _SHARING.format(n=n, next=following)
        elif family == "queues":
            channels += f"\n  q{n}: {{from: Producer{n}, to: Consumer{n}, message: M, capacity: 9}}"
            components += _PAIR.format(n=n)
        else:
            channels += f"\n  q{n}: {{from: Counter{n}, to: Counter{following}, message: N, capacity: 2}}"
            components += _COUNTER.format(n=n, before=before)
    messages = "  M: {fields: {}}\n  N: {fields: {value: {type: int}, same: {type: bool}}}"
    links = f"channels:{channels}\n" if channels else ""
    text = f"parcours: model/1\nname: bench\nmessages:\n{messages}\n{links}components:{components}\n"
    return parse_model(text, f"{family} {size}")


def measure(family: str, size: int) -> dict[str, float]:
    """Return what one exploration took, in this process."""
    cefsm = model(family, size)
    begun, began = time.perf_counter(), time.process_time()
    space = explore(cefsm, max_states=2_000_000)
    return {
        "states": space.n_states,
        "moves": space.n_transitions,
        "complete": space.complete,
        "elapsed": time.perf_counter() - begun,
        "processor": time.process_time() - began,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def main() -> None:
    """Print a line for each family and decade."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--largest", type=int, choices=(3, 4, 5, 6), default=6, help="decade of configurations")
    parser.add_argument("--one", nargs=2, metavar=("FAMILY", "SIZE"), help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.one:
        print(json.dumps(measure(chosen.one[0], int(chosen.one[1]))))
        return
    print("    family  n    states      moves    elapsed  processor  states/s   moves/s    memory")
    for family, sizes in SIZES.items():
        for decade in range(3, chosen.largest + 1):
            arguments = [sys.executable, __file__, "--one", family, str(sizes[decade])]
            done = subprocess.run(arguments, capture_output=True, text=True, check=True)
            got = json.loads(done.stdout)
            print(
                f"{family:>10} {sizes[decade]:>2} {got['states']:>9} {got['moves']:>10} {got['elapsed']:>8.2f} s"
                f" {got['processor']:>8.2f} s {got['states'] / got['processor']:>9.0f}"
                f" {got['moves'] / got['processor']:>9.0f} {got['memory']:>6.0f} MB"
                f"{'' if got['complete'] else '  (stopped)'}"
            )


if __name__ == "__main__":
    main()
