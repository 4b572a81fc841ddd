"""Results of the paper's study -> one page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from parcours.report.pieces import Cause, Column, Failing, Failures, Marked, Page, Section, Summary, Text
from parcours.study.provenance import provenance
from parcours.study.reporting import percent
from parcours.verdict.judgement import Verdict
from parcours_navigation.outcomes import VERDICT_OF, Outcome, explain, outcomes, published
from parcours_navigation.study.outcome_tables import OUTCOME_WORDS
from parcours_ramp.paper.component_chapters import abstract_chapter, models_chapter, paths_chapter, results_chapter
from parcours_ramp.paper.delays_chapter import delays_chapter
from parcours_ramp.paper.outcomes_chapter import outcomes_chapter, replays_chapter
from parcours_ramp.paper.results import PaperResults
from parcours_ramp.paper.system_chapters import (
    coverage_chapter,
    headline,
    inputs_chapter,
    measures_chapter,
    time_left_chapter,
    vectors_chapter,
)
from parcours_ramp.system.study import SCHEDULES

_LISTED = 100  # cases of a schedule and cause

_READING = """\
**Paper** means a number printed in the paper or computed from its authors' public raw results. **Reconstructed** means
that the paper names a result but not how it comes about: the serialisation algorithm behind the 67 abstract cases, the
contents of the ten message blocks, and the published planner's latencies, which are fitted to its public logs.

Known gaps of the paper are shown, not smoothed over: 67 is not 19 + 49; two messages have no receiver; the share of
robots that paused and moved again is 18 % in the text and 23.1 % in the data; the domains of v and w are open while
their blocks are closed.

By how much `original` differs from the published rates, and why we think so, stands in the outcomes chapter.
"""


def compose(results: PaperResults) -> Page:
    """Return the whole report."""
    campaign = results.system["table-vii", "original"]
    facts = (
        *provenance().items(),
        ("seed", str(results.seed)),
        ("system cases", f"{len(campaign.facts)} per schedule"),
        ("component cases", f"{len(results.functional)} functional, {len(results.timing)} timing"),
    )
    reading = Section("How to read this report", "", (Text(_READING),), "reading")
    short = (headline(results), *_failing(results), reading, replays_chapter(results))
    paper: tuple[Section, ...] = (
        outcomes_chapter(results),
        vectors_chapter(results),
        time_left_chapter(results),
        measures_chapter(results),
        delays_chapter(results.delays),
        inputs_chapter(results),
        models_chapter(results),
        paths_chapter(),
        abstract_chapter(),
        results_chapter(results),
        coverage_chapter(results),
    )
    sections = [replace(one, part=part) for part, of in (("In short", short), ("The paper", paper)) for one in of]
    return Page(
        "Model-based testing of RAMP, repeated",
        "Abdelgawad, McLeod, Andrews, Xiao: *Model-based Testing of Real-time Adaptive Motion Planning*",
        facts,
        tuple(sections),
        _summary(results),
    )


def _summary(results: PaperResults) -> Summary:
    """Return what a manager needs: what was tested, what came of it, what to do."""
    parts = len(results.functional)
    passed = sum(run.judgement.passed for run in results.functional)
    original, guarded = (results.system["table-vii", schedule].facts for schedule in SCHEDULES)
    n = len(original)
    stuck = [published(facts).stuck.mean() for facts in (original, guarded)]
    reached = [published(facts).reached.mean() for facts in (original, guarded)]
    hit = [int((outcomes(facts) == Outcome.COLLIDED).sum()) for facts in (original, guarded)]
    return Summary(
        f"RAMP, a motion planner for robots among moving obstacles, was tested part by part in {parts} cases and as a "
        f"whole robot in {n} cases, each with the published schedule (*original*) and with our repair (*guarded*).",
        f"Its parts passed {passed} of {parts} cases; the whole robot does not always arrive.", "poor",
        (
            f"It stood still, a collision imminent, when the test ended in {percent(stuck[0])} of the cases; repaired, "
            f"in {percent(stuck[1])}. The authors published 7.7 %.",
            f"It reached its goal within 20 s in {percent(reached[0])} of the cases; repaired, in "
            f"{percent(reached[1])}.",
            f"It caused a collision in {hit[0]} cases; repaired, in {hit[1]}. Nobody had tested for that.",
        ),
        "Use the guarded schedule. [The failing cases](#failures) say what is left to repair, and "
        "[the replays](#replays) show it.",
    )  # fmt: skip


def _failing(results: PaperResults) -> tuple[Section, ...]:
    """Return the cases that failed, of both schedules."""
    causes = []
    for schedule in SCHEDULES:
        campaign = results.system["table-vii", schedule]
        facts, codes = campaign.facts, outcomes(campaign.facts)
        for outcome in (one for one in Outcome if VERDICT_OF[one] is Verdict.FAIL):
            places = np.flatnonzero(codes == int(outcome))
            worst = places[np.argsort(facts["min_clearance"][places], kind="stable")][:_LISTED]
            run = f"parcours run ramp_system --schedule {schedule} --seed {results.seed} --case"
            cases = tuple(
                Failing(
                    f"{schedule}/{(id := campaign.cases.id(int(facts['number'][k]))).partition('/')[2]}",
                    Marked("fail", "bad"), explain(facts[k]), (float(facts["min_clearance"][k]),),
                    (f"{run} {id} --out out/again", f"parcours replay out/again {id} --html case.html"),
                )
                for k in worst
            )  # fmt: skip
            if cases:
                causes.append(Cause(f"{OUTCOME_WORDS[outcome]}, {schedule}", len(places), cases))
    causes.sort(key=lambda cause: -cause.count)
    found = Failures("Cases of the whole robot", tuple(causes), (Column("least clearance", ".3f", unit="m"),))
    lead = "Grouped by schedule and cause, of each the cases with the least clearance first."
    return (Section("Cases that failed", lead, (found,), "failures"),) if causes else ()
