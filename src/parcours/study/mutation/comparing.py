"""The same mutants under several suites of a study: which criterion notices more, and do random tests as well?"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

from parcours.report.pieces import Cell, Column, Table
from parcours.study.components.study import ComponentStudy
from parcours.study.mutation.observing import TWIN
from parcours.study.mutation.results import MutationResults
from parcours.study.mutation.running import MutationRequest, mutate
from parcours.study.mutation.suites import COMPARED, RANDOM, Suite, with_suite
from parcours.study.protocol import Progress
from parcours.verdict.statistics import wilson

_NOTE = (
    "Scores are shares of the mutants that have an effect in any of these suites, with Wilson's 95 % interval. Random"
    " tests are random walks with random blocks: the first of them, as many as the suite has cases. A case that the"
    " original does not pass notices nothing."
)


@dataclasses.dataclass(frozen=True, slots=True)
class SuiteComparison:
    """What became of the same mutants under each suite: its results, and how many cases it has."""

    study: str
    found: Mapping[Suite, tuple[MutationResults, int]]

    def effective(self) -> set[str]:
        """Return the ids of the mutants that have an effect in any suite."""
        return {mutant.id for results, _ in self.found.values() for mutant, _ in results.effective()}

    def noticed(self, suite: Suite, first: int | None = None) -> set[str]:
        """Return the ids of the mutants that a suite notices, in its first cases if a number is given."""
        results, _ = self.found[suite]
        return {
            mutant.id
            for mutant, outcome in results.finished()
            if any(stage != TWIN and (first is None or outcome.at.get(stage, 0) < first) for stage in outcome.seen)
        }

    def table(self) -> Table:
        """Return the scores."""
        n = len(self.effective())
        random = next((suite for suite in self.found if suite.paths == RANDOM), None)
        rows: list[tuple[Cell, ...]] = []
        for suite, (results, cases) in self.found.items():
            rate = wilson(len(self.noticed(suite)), n)
            sound = max((one.sound for one in results.outcomes.values()), default=0)
            row: list[Cell] = [suite.name, cases, sound, rate.count, rate.share, rate.low, rate.high]
            if random is None or suite == random:
                row += [None, None]
            else:
                chance = wilson(len(self.noticed(random, cases)), n)
                row += [chance.count, chance.share]
            rows.append(tuple(row))
        columns = (
            Column("suite"), Column("cases", ",d"), Column("original passes", ",d"), Column("noticed", ",d"),
            Column("score", ".1%"),
            Column("from", ".1%"), Column("to", ".1%"), Column("random, as many", ",d"), Column("random score", ".1%"),
        )  # fmt: skip
        return Table(f"{n} mutants of {self.study} with an effect, by suite", columns, tuple(rows), _NOTE)

    def document(self) -> dict[str, object]:
        """Return the scores as JSON values."""
        n = len(self.effective())
        suites = {suite.name: {"cases": cases, "noticed": len(self.noticed(suite))}
                  for suite, (_, cases) in self.found.items()}  # fmt: skip
        return {"study": self.study, "with_effect": n, "suites": suites}


def compare(
    study: ComponentStudy, request: MutationRequest, out: Path, progress: Progress, suites: Sequence[Suite] = COMPARED
) -> tuple[SuiteComparison, bool]:  # fmt: skip
    """Run the mutants of a study under each suite, in one build; return what came of it, and whether Ctrl-C ended it.

    Of random tests there are as many as the largest other suite has. If a number of cases is asked for, a suite's are
    drawn from all interactions alike.
    """
    found: dict[Suite, tuple[MutationResults, int]] = {}
    for one in suites:
        suite = dataclasses.replace(one, mixed=request.cases is not None)
        most = max((cases for _, cases in found.values()), default=0)
        asked = max(most, 1) if suite.paths == RANDOM else request.cases
        chosen = with_suite(study, suite, request.seed)
        assert isinstance(chosen, ComponentStudy)
        n = len(chosen.plan(request.seed, asked))
        n = min(n, request.cases or n)
        ours = dataclasses.replace(request, suite=suite, cases=n)
        results, interrupted = mutate((study,), ours, out / suite.name, progress, out)
        # Cases that contradict themselves are left out, which only those who ran the suite know.
        found[suite] = results, max((one.suite for one in results.outcomes.values()), default=n) or n
        if interrupted:
            return SuiteComparison(study.name, found), True
    return SuiteComparison(study.name, found), False
