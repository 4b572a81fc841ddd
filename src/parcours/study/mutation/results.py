"""What became of the mutants of a study: scores by stage and operator, and those that survived."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import cast

import numpy as np

from parcours.report.pieces import Cause, Cell, Column, Failing, Failures, Marked, Page, Section, Summary, Table, Tone
from parcours.study.mutation.fork_server import Kind, MutantOutcome
from parcours.study.mutation.mutant import Mutant
from parcours.study.mutation.observing import CASES, CHECK, CONFORMANCE, STAGES, TWIN
from parcours.study.protocol import Measure
from parcours.study.reproducing import Reruns

_NOTE = (
    "A mutant has an effect if some stage or the golden twin saw it: the twin compares the bytes of all that is sent"
    " with the original's. Scores are shares of the mutants with an effect; what ends in a timeout, a hang or a death"
    " is noticed by the first stage."
)


def entry_of(outcome: MutantOutcome) -> dict[str, object]:
    """Return an outcome as a line of a journal."""
    return asdict(outcome)


def outcome_of(entry: Mapping[str, object]) -> MutantOutcome:
    """Return the outcome that a line of a journal holds."""
    seen = cast("Mapping[str, Sequence[str]]", entry["seen"])
    return MutantOutcome(
        str(entry["end"]), {stage: (by[0], by[1]) for stage, by in seen.items()}, int(cast(int, entry["cases"])),
        dict(cast("Mapping[str, int]", entry.get("at", {}))), int(cast(int, entry.get("suite", 0))),
        int(cast(int, entry.get("sound", 0))), str(entry.get("facts", "")),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class MutationResults:
    """The mutants of one study, and the outcomes that are there."""

    study: str
    of: Kind
    mutants: tuple[Mutant, ...]
    outcomes: Mapping[str, MutantOutcome]

    def finished(self) -> Iterator[tuple[Mutant, MutantOutcome]]:
        """Yield the mutants that ran, with their outcomes."""
        for one in self.mutants:
            if one.id in self.outcomes and self.outcomes[one.id].end != "refused":
                yield one, self.outcomes[one.id]

    @property
    def stages(self) -> list[str]:
        """The stages in their order, the golden twin last."""
        found = {stage for _, one in self.finished() for stage in one.seen}
        always = {CASES, CONFORMANCE} if self.of != "code" or CASES in found else set()
        always |= {CHECK} if self.of == "model" else set()
        return [one for one in STAGES if one in found | always]

    def effective(self) -> list[tuple[Mutant, MutantOutcome]]:
        """Return the mutants with a visible effect; of a model, all of them."""
        return [(mutant, outcome) for mutant, outcome in self.finished() if outcome.seen or self.of == "model"]

    def survivors(self) -> list[tuple[Mutant, MutantOutcome]]:
        """Return the mutants with a visible effect that no stage noticed."""
        return [(mutant, outcome) for mutant, outcome in self.effective() if set(outcome.seen) <= {TWIN}]

    @staticmethod
    def seen_by(outcome: MutantOutcome) -> str:
        """Return which oracle would have seen a survivor: where the golden twin sees it differ from the original."""
        case, what = outcome.seen.get(TWIN, ("", ""))
        return "; ".join(part for part in (what, f"in {case}" if case else "") if part)

    def measures(self) -> Mapping[str, Measure]:
        """Return the score, the share of mutants with an effect that some stage noticed; and each stage's."""
        effective = [outcome for _, outcome in self.effective()]

        def rate(noticed: list[bool]) -> Measure:
            return Measure(np.array(noticed, float), worse="less")

        stages = {stage.replace(" ", "_"): rate([stage in one.seen for one in effective]) for stage in self.stages}
        return {"score": rate([not set(one.seen) <= {TWIN} for one in effective]), **stages}

    def tables(self) -> list[Table]:
        """Return the score by stage and by operator."""
        effective = self.effective()
        n, counts = len(effective), Counter(outcome.end for outcome in self.outcomes.values())
        rows: list[tuple[Cell, ...]] = []
        so_far: set[str] = set()
        for stage in self.stages:
            seen = {mutant.id for mutant, outcome in effective if stage in outcome.seen}
            so_far |= seen
            rows.append((stage, len(seen), _share(len(seen), n), len(so_far), _share(len(so_far), n)))
        columns = (Column("stage"), Column("noticed", ",d"), Column("score", ".1%"), Column("noticed so far", ",d"),
                   Column("cumulated", ".1%"))  # fmt: skip
        ends = ", ".join(f"{count} {end}" for end, count in counts.items() if end != "ended")
        if self.of == "model":
            title = f"Mutants of the model of {self.study}: which of {n} wrong models are noticed by clean runs?"
            return [Table(title, columns, tuple(rows)), self._operators()]
        unseen = [outcome.cases for _, outcome in self.finished() if not outcome.seen]
        said = f"{len(self.outcomes)} of {len(self.mutants)} ran: {n} have an effect"
        if shown := [one for one in unseen if one]:
            said += f", {len(shown)} none in up to {max(shown)} cases"
        said += f", {unseen.count(0)} are reached by no case" if 0 in unseen else ""
        title = f"Mutants of {self.study}: {said}{f'; {ends}' if ends else ''}"
        return [Table(title, columns, tuple(rows), _NOTE), self._operators()]

    def _operators(self) -> Table:
        rows: list[tuple[Cell, ...]] = []
        finished = list(self.finished())
        for operator in sorted({mutant.operator for mutant, _ in finished}):
            mine = [outcome for mutant, outcome in finished if mutant.operator == operator]
            seen = [one for one in mine if one.seen or self.of == "model"]
            noticed = sum(not set(one.seen) <= {TWIN} for one in seen)
            rows.append((operator, len(mine), len(seen), noticed, _share(noticed, len(seen))))
        columns = (Column("operator"), Column("mutants", ",d"), Column("with an effect", ",d"), Column("noticed", ",d"),
                   Column("score", ".1%"))  # fmt: skip
        return Table("By operator", columns, tuple(rows))

    def document(self) -> dict[str, object]:
        """Return everything as JSON values."""
        scores = {name: float(one.values.mean()) if len(one.values) else None for name, one in self.measures().items()}
        mutants = [
            {"id": one.id, "operator": one.operator, "file": one.file, "line": one.line, "change": one.change,
             "diff": one.diff, **self._twin(one),
             **(entry_of(self.outcomes[one.id]) if one.id in self.outcomes else {"end": ""})}
            for one in self.mutants
        ]  # fmt: skip
        return {"study": self.study, "scores": scores, "mutants": mutants}

    def _twin(self, mutant: Mutant) -> dict[str, object]:
        outcome = self.outcomes.get(mutant.id)
        return {"seen_by": self.seen_by(outcome)} if outcome is not None and set(outcome.seen) == {TWIN} else {}


def mutation_page(
    found: MutationResults, made: Mapping[str, str], command: Sequence[str], repeated: Reruns
) -> Page:  # fmt: skip
    """Return the page on mutants: what the tests notice, the mutants that they do not, the tables.

    Args:
        made: where the results come from (`parcours.study.provenance`).
        command: runs them again.
        repeated: what became of noticed mutants that were run again.
    """
    effective, survivors = found.effective(), found.survivors()
    n, lost, planned = len(effective), len(survivors), len(found.mutants)
    verdict = (
        f"The tests noticed {n - lost} of {n} mutants that have an effect{f' ({(n - lost) / n:.1%})' if n else ''}."
    )
    tone: Tone = "poor" if lost or not n else "good"
    by_stage = {stage: sum(stage in one.seen for _, one in effective) for stage in found.stages if stage != TWIN}
    facts = [*repeated.warning()]
    facts += [f"{len(found.outcomes)} of {planned} mutants ran; {len(found.outcomes) - n} have no visible effect."]
    if by_stage and n:
        best = max(by_stage, key=lambda stage: by_stage[stage])
        facts.append(f"*{best}* notices most: {by_stage[best]} of {n}.")
    causes = []
    for operator, count in Counter(mutant.operator for mutant, _ in survivors).most_common():
        mine = [(mutant, outcome) for mutant, outcome in survivors if mutant.operator == operator]
        rows = [_survivor(found, mutant, outcome, command) for mutant, outcome in mine]
        causes.append(Cause(operator, count, tuple(rows)))
    if causes:
        facts.append(f"Most survivors are of one kind: [{causes[0].words}](#cause_1), {causes[0].count} of {lost}.")
    advice = (
        "Start with [the survivors](#failures): each is a change of behaviour that no test sees. Give the study an "
        "oracle that looks at what it changes, and run the command again."
        if lost else "Make the score a gate: with `--fail-if`, a build fails when the tests get weaker."
    )  # fmt: skip
    lead = "Changes to the code or the model that no stage of the tests noticed, by kind of change."
    listed = [
        Section("Mutants that survived", lead, (Failures("Survivors", tuple(causes), what="mutant"),), "failures")
    ]
    return Page(
        f"Mutants of {found.study}", "", (*made.items(), ("run again", str(repeated))),
        (*(listed if causes else ()), Section("Scores", "", tuple(found.tables()), "scores")),
        Summary(f"The {found.of} of **{found.study}** got small changes, one at a time: do its tests notice?",
                verdict, tone, tuple(facts), advice),
    )  # fmt: skip


def _survivor(found: MutationResults, mutant: Mutant, outcome: MutantOutcome, command: Sequence[str]) -> Failing:
    why = f"{mutant.place}: {mutant.change}"
    seen = found.seen_by(outcome) if found.of != "model" else ""
    ends = (["--out", "out/mutant"], ["--list"])  # run it alone, and print the change
    again = tuple(shlex.join([*command, "--only", mutant.id, *end]) for end in ends if command)
    why = f"{why}; seen by the golden twin: {seen}" if seen else why
    return Failing(mutant.id, Marked("survived", "poor"), why, (), again)


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
