"""Prints what oracles say against clean cases of RAMP: each such word is a false alarm (docs/evidence.md).

Component cases run with references, second programs and relations; system cases component by component, both
schedules and both protocols, their messages judged by order, formulas and references, their facts held against the
compiled loop's.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Iterator

from parcours.study.components import executing
from parcours.verdict.judgement import Judgement
from parcours_ramp.components.study import component_study
from parcours_ramp.system import door as system
from parcours_ramp.system.sampling import judge_sampled


def component_cases(n: int, seed: int) -> Iterator[tuple[str, Judgement]]:
    """Yield the verdicts of n component cases, from one seed after the other."""
    study = component_study()
    settings = {one.name: one.default for one in study.parameters}
    exercise = study.exercise(settings)
    run = executing.in_process(exercise)
    while n > 0:
        for case in study.suite(settings, seed, min(n, len(study.plan(seed)))):
            yield f"seed {seed}, {case.id}", executing.run_functional(exercise, case, run).judgement
            n -= 1
        seed += 1


def system_cases(n: int, seed: int, seconds: float) -> Iterator[tuple[str, Judgement]]:
    """Yield the verdicts of n system cases that end after this many seconds and are not observed further."""
    door = system.study()
    settings = {one.name: one.default for one in door.parameters} | {"time_limit": seconds}
    kinds = [(one, other) for one in ("guarded", "original") for other in ("published", "table-vii")]
    studies = [
        dataclasses.replace(door.study({**settings, "schedule": one, "protocol": other}, seed), watched_on=0.0)
        for one, other in kinds
    ]
    for k in range(n):
        schedule, protocol = kinds[k % len(kinds)]
        where = f"seed {seed}, {schedule}, {protocol}, case {k // len(kinds)}"
        yield where, judge_sampled(studies[k % len(kinds)], k // len(kinds)).judgement


def look_at(what: str, found: Iterator[tuple[str, Judgement]]) -> None:
    """Print how many verdicts are no pass, and which."""
    start, n, alarms = time.process_time(), 0, 0
    for where, judgement in found:
        n += 1
        start = time.process_time() if n == 1 else start  # the first one compiles
        if not judgement.passed:
            alarms += 1
            print(f"{where}: {judgement.verdict}: {judgement.why}", flush=True)
        if n % 500 == 0:
            print(f"{what}: {n}, alarms {alarms}", flush=True)
    print(f"{what}: {n}, alarms {alarms}, {(time.process_time() - start) / max(n - 1, 1):.3f} s of processor time each")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--component", type=int, default=201, help="component cases [default: 201]")
    parser.add_argument("--system", type=int, default=40, help="system cases [default: 40]")
    parser.add_argument("--seconds", type=float, default=1.5, help="after which system cases end [default: 1.5]")
    parser.add_argument("--seed", type=int, default=1, help="the first one [default: 1]")
    asked = parser.parse_args()
    look_at("component cases", component_cases(asked.component, asked.seed))
    look_at("system cases", system_cases(asked.system, asked.seed, asked.seconds))
