"""Prints what makes `original` stuck: the same cases, with one thing changed at a time (docs/repair.md).

Also how often it reaches the goal, beside the published folders 2 to 8, if the protocol is the published one.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from parcours.verdict.statistics import compare_pairs, compare_with_published, wilson
from parcours_navigation.cases.family import PROTOCOLS, SystemCases
from parcours_navigation.cases.published import PUBLISHED, folder_of
from parcours_navigation.outcomes import Outcome, outcomes, published, touched
from parcours_ramp.planner.latency import none
from parcours_ramp.planner.parameters import guarded, original
from parcours_ramp.system.study import SystemStudy

Facts = NDArray[np.void]

CHANGES: dict[str, dict[str, Any]] = {
    "as published": {},
    "no latency": {"latencies": none()},
    "halts at once": {"parameters": original(halts_at_once=True)},
    "looks a constant time ahead": {"parameters": original(looks_ahead=True)},
    "may leave what it is too near to": {"parameters": original(may_leave=True)},
    "keeps 0.05 m of clearance": {"parameters": original(plan_margin=0.05)},
    "control period of 0.5 s": {"parameters": original(control_period=0.5)},
    "solid obstacles": {"solid": True},
    "looks ahead and may leave": {"parameters": original(looks_ahead=True, may_leave=True)},
    "guarded": {"parameters": guarded()},
}

ASKED: dict[str, Callable[[Facts], NDArray[np.bool_]]] = {
    "stuck (flag at the end)": lambda facts: published(facts).stuck,
    "stopped for good": lambda facts: np.asarray(outcomes(facts) == Outcome.STUCK),
    "goal reached": lambda facts: published(facts).reached,
    "robot caused a collision": touched,
}


def folders_2_to_8(facts: Facts) -> str:
    """Return how often the goal was reached in the cases of the published folders 2 to 8, and there."""
    theirs = [runs for runs in PUBLISHED if runs.folder > 1]
    reached, n = sum(runs.reached for runs in theirs), sum(runs.n for runs in theirs)
    ours = published(facts).reached[[folder_of(int(number)).folder > 1 for number in facts["number"]]]
    rate = wilson(int(ours.sum()), len(ours))
    p = compare_with_published(int(ours.sum()), len(ours), reached, n).p_value
    return (
        f"goal reached, folders 2 to 8: {rate.share:.1%} [{rate.low:.1%}, {rate.high:.1%}] of {rate.n}, "
        f"published {reached / n:.1%} of {n}, p = {p:.2g} (Fisher)"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--protocol", choices=PROTOCOLS, default="table-vii")
    given = parser.parse_args()
    cases = SystemCases(given.seed, given.protocol, study="ramp_system")
    print(f"{given.cases} cases of seed {given.seed}, {given.protocol}; in brackets p by McNemar's exact test")
    print("|", " | ".join(("original, but", *ASKED)), "|\n|---" + "|---" * len(ASKED) + "|")
    first: dict[str, NDArray[np.bool_]] = {}
    said = ""
    published_system = SystemStudy(cases, original())
    for change, changed in CHANGES.items():
        facts = dataclasses.replace(published_system, **changed)(0, given.cases)
        if not first:
            stands = outcomes(facts) == Outcome.STUCK
            met = (facts["min_clearance"] <= 0.0)[stands].mean()
            said = f"of those that stopped for good, an obstacle had touched {met:.1%}\n"
            pointless = (facts["time_left"] < 0.11) & published(facts).stuck
            said += f"of the stuck, {pointless.sum()} of {published(facts).stuck.sum()} had a trajectory of one point\n"
            said += folders_2_to_8(facts) if given.protocol == "published" else ""
        cells = []
        for words, rule in ASKED.items():
            flags = rule(facts)
            p = compare_pairs(first.setdefault(words, flags), flags).p_value
            cells.append(f"{flags.mean():.2%}" + ("" if change == "as published" else f" ({p:.2g})"))
        print("|", " | ".join((change, *cells)), "|", flush=True)
    print(said)


if __name__ == "__main__":
    main()
