"""How many system cases of RAMP one core runs in a second, against real time and against the machine's arithmetic.

python bench/bench_system.py --cases 905 --seed 0

Processor time of one core, compiled kernels on disk, best of several runs. `published` is the paper's case: one static
second and 20 s, ended by reaching the goal. `observed` is what `parcours run ramp_system` does: a robot that is not
there yet is watched for up to 40 s more. The ratio to real time counts what was really simulated, not the 21 s a case
may last. Facts and measures of every case are included, and so is drawing the case, which is also shown by itself.

The arithmetic limit is that of an exhaustive evaluation, which tests every sample of every trajectory against every
obstacle: trajectories and obstacles a case as counted in these very cases, samples a trajectory as the one that is
followed has on average (10 a second; the other members are rather longer), and the two rates of tests of
`arithmetic_limit.py`: in vectors, which is the most the core gives, and one at a time, as a plain loop does. Such an
evaluation takes at least that long, before anything is generated, predicted or moved.

The last line is for machines: the published cases of the schedule that `parcours run` takes by default.
"""

from __future__ import annotations

import argparse
import dataclasses
import time

import numpy as np
from arithmetic_limit import OPERATIONS, count_hits, first_hit, tests_a_second
from numpy.typing import NDArray

from parcours.kernels import is_warm
from parcours_navigation.cases.family import PUBLISHED_CASES, WATCHED_ON
from parcours_navigation.facts import NEVER
from parcours_ramp.planner.messages import SAMPLE
from parcours_ramp.system.door import study as ramp_system
from parcours_ramp.system.ramp_facts import TRANSITIONS
from parcours_ramp.system.study import SCHEDULES, SystemStudy, system_study

DEFAULT = str(next(one.default for one in ramp_system().parameters if one.name == "schedule"))

LOOKS = (1.0, 4.0, 7.0, 10.0, 13.0, 16.0, 19.0)
"""When the length of the trajectory followed is looked at, after the static second [s]."""

YARDSTICK = (10, 100, 3, 400)
"""Trajectories, samples, obstacles and planning cycles of a round case, for comparison between machines."""


def processor_time(study: SystemStudy, cases: int, tries: int) -> tuple[float, NDArray[np.void]]:
    """Return the least processor time that the cases took [s], and their facts."""
    best, facts = np.inf, study(0, 1)
    for _ in range(tries):
        begun = time.process_time()
        facts = study(0, cases)
        best = min(best, time.process_time() - begun)
    return float(best), facts


def drawing_time(study: SystemStudy, cases: int, tries: int) -> float:
    """Return the least processor time that drawing the cases took [s]."""
    best = np.inf
    for _ in range(tries):
        begun = time.process_time()
        study.cases.obstacles(np.arange(cases))
        best = min(best, time.process_time() - begun)
    return float(best)


def simulated_seconds(study: SystemStudy, facts: NDArray[np.void]) -> float:
    """Return how much time passed in these cases, in all [s]."""
    watched = (1.0 + study.time_limit + study.watched_on) * 1e9
    late = np.where(facts["t_goal_after"] != NEVER, facts["t_goal_after"], watched)
    return float(np.where(facts["t_goal"] != NEVER, facts["t_end"], late).sum()) * 1e-9


def exhaustive_tests(study: SystemStudy, facts: NDArray[np.void], cases: int) -> tuple[float, float, int]:
    """Return trajectories evaluated a case, samples of one, and obstacles they are tested against.

    What the robot is doing already is evaluated as well, over a shorter stretch; that is not counted.
    """
    taken = dict(zip(TRANSITIONS, facts["transitions"].mean(axis=0).tolist(), strict=True))
    candidates = taken["p32"] - taken["p17"] - taken["p18"] - 2.0 * taken["p12"]
    trajectories = study.parameters.population * (taken["p18"] + taken["p12"]) + candidates
    samples = []
    for look in LOOKS:
        seen = dataclasses.replace(study, time_limit=look)(0, cases)
        samples.append(seen["time_left"][seen["t_goal"] == NEVER] / SAMPLE + 1.0)
    each = float(np.concatenate(samples).mean())
    obstacles = study.cases.obstacles(np.arange(1)).shape[1]
    return trajectories, each, obstacles


def rates(study: SystemStudy, what: str, cases: int, tries: int) -> tuple[float, NDArray[np.void]]:
    """Print a line for the cases; return how many a second one core ran, and their facts."""
    taken, facts = processor_time(study, cases, tries)
    simulated = simulated_seconds(study, facts)
    print(
        f"{study.parameters.schedule:>10}  {what:<10} {taken:>9.2f} s {cases / taken:>10.0f}"
        f" {1e3 * taken / cases:>9.3f} ms {simulated / cases:>9.1f} s {simulated / taken:>11.0f} x",
        flush=True,
    )
    return cases / taken, facts


def limit(study: SystemStudy, facts: NDArray[np.void], cases: int, rate: float, speeds: dict[str, float]) -> None:
    """Print how the whole case compares with what exhaustive evaluation alone would take at least."""
    trajectories, samples, obstacles = exhaustive_tests(study, facts, min(cases, 100))
    needed = trajectories * samples * obstacles
    ours = 1e3 / rate
    print(
        f"{study.parameters.schedule:>10}: {trajectories:.0f} trajectories x {samples:.0f} samples x {obstacles}"
        f" obstacles = {needed:.0f} tests a case; the whole case takes {ours:.3f} ms"
    )
    for how, tests in speeds.items():
        least = 1e3 * needed / tests
        print(
            f"{'':>12}{how:<14} the exhaustive evaluation alone would need at least {least:.3f} ms/case;"
            f" ours takes {ours / least:.2f} times that"
        )


def main() -> None:
    """Time both schedules, published and observed further, and compare; the last line is for machines."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=PUBLISHED_CASES, help="cases a schedule")
    parser.add_argument("--seed", type=int, default=0, help="campaign seed")
    parser.add_argument("--tries", type=int, default=3, help="the best of this many runs counts")
    chosen = parser.parse_args()
    for option in ("cases", "tries"):
        if getattr(chosen, option) < 1:
            parser.error(f"--{option} must be at least 1, but is {getattr(chosen, option)}")
    if not is_warm():
        print("no compiled kernels on disk: compiling first, which is not timed here", flush=True)
    print(f"system cases of RAMP: {chosen.cases} cases, seed {chosen.seed}, one core, best of {chosen.tries}")
    print(
        f"{'schedule':>10}  {'case':<10} {'processor':>11} {'cases/s':>10} {'a case':>12} {'simulated':>11}"
        f" {'x real time':>13}"
    )
    published = {}
    for schedule in SCHEDULES:
        study = system_study(schedule, seed=chosen.seed)
        short = dataclasses.replace(study, watched_on=0.0)
        rate, facts = rates(short, "published", chosen.cases, chosen.tries)
        published[schedule] = short, facts, rate
        rates(study, "observed", chosen.cases, chosen.tries)
    drawing = drawing_time(published[DEFAULT][0], chosen.cases, chosen.tries) / chosen.cases
    share = drawing * published[DEFAULT][2]
    print(
        f"drawing a case from its number: {1e3 * drawing:.3f} ms of these, {share:.0%} of a published case ({DEFAULT})"
    )
    print(f"published: 1 + 20 s at most, over when the goal is reached; observed: up to {WATCHED_ON:.0f} s more\n")

    speeds = {"in vectors": tests_a_second(count_hits), "one at a time": tests_a_second(first_hit)}
    print(
        f"arithmetic limit of this core: sample-obstacle tests of {OPERATIONS} floating-point operations, nothing else"
    )
    for how, tests in speeds.items():
        least = 1e3 * np.prod(YARDSTICK) / tests
        print(
            f"{'':>12}{how:<14} {1e-9 * tests:>5.2f} x 10^9 tests/s ({1e-9 * OPERATIONS * tests:.1f} Gflop/s):"
            f" {' x '.join(map(str, YARDSTICK))} of them take {least:.3f} ms"
        )
    for study, facts, rate in published.values():
        limit(study, facts, chosen.cases, rate, speeds)
    print()
    print(f"schedule {DEFAULT}, published cases ({', '.join(f'{k} {v[2]:.0f}' for k, v in published.items())})")
    print(f"system cases/s/core: {published[DEFAULT][2]:.0f}")


if __name__ == "__main__":
    main()
