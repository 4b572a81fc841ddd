"""The README's table of results is what the seed it names really gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from parcours.verdict.statistics import Rate, wilson
from parcours_navigation.cases.family import PUBLISHED_CASES
from parcours_navigation.outcomes import Outcome, outcomes, published
from parcours_ramp.system.study import system_study

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def spelled(rate: Rate) -> str:
    return f"{rate.share * 100:.1f} % [{rate.low * 100:.1f}, {rate.high * 100:.1f}]"


def test_the_readme_states_the_rates_that_seed_1_gives() -> None:
    facts = {s: system_study(s, seed=1).run(np.arange(PUBLISHED_CASES)) for s in ("original", "guarded")}
    rows = {
        "stuck in imminent collision": {s: published(f).stuck for s, f in facts.items()},
        "goal reached within 20 s": {s: published(f).reached for s, f in facts.items()},
    }
    rows["of these, after an obstacle had driven through the robot"] = {
        s: f["n_obstacle_contacts"][published(f).reached] > 0 for s, f in facts.items()
    }
    for words, flags in rows.items():
        rates = [spelled(wilson(int(mine.sum()), len(mine))) for mine in flags.values()]
        line = next(line for line in README.splitlines() if line.startswith(f"| {words}"))
        assert line.endswith(f"| {rates[0]} | {rates[1]} |")
    touched = [int((outcomes(f) == Outcome.COLLIDED).sum()) for f in facts.values()]
    assert f"| {touched[0]} of 905 | {touched[1]} of 905 |" in README
    like = published(system_study("original", seed=1, protocol="published").run(np.arange(PUBLISHED_CASES))).stuck
    assert f"is stuck in {spelled(wilson(int(like.sum()), len(like)))}" in " ".join(README.split())
