"""What is kept of cases that were run again component by component, and the campaign with it (see `sampling`)."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadResults
from parcours.report.junit import CaseResult
from parcours.report.pieces import Column, Table
from parcours.study.comparing import Counted, Outline
from parcours.study.covering import Drawn, Marks
from parcours.study.protocol import Reported
from parcours.verdict.judgement import Verdict
from parcours_navigation.study.campaigns import FinishedCampaign
from parcours_navigation.study.results import PlannerResults
from parcours_ramp.system.ramp_facts import TRANSITIONS

FILE = "sampled.json"


def read_sampled(folder: Path) -> dict[str, dict[str, str]]:
    """Return the verdict of each sampled case by its number, why, and what it met; empty if none was run.

    Raises BadResults: they cannot be read.
    """
    path = folder / FILE
    if not path.exists():
        return {}
    try:
        document = json.loads(path.read_bytes())
        return {
            str(int(k)): {
                "verdict": str(Verdict(v["verdict"])),
                "why": str(v["why"]),
                "pairs": str(v.get("pairs", "")),
                "judged": f"{int(v.get('judged', '0'), 16):x}",
            }
            for k, v in document.items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        rule = f"sampled cases must be readable, but: {error}"
        raise BadResults(str(path), rule, "delete it, and run the command again", slug="results-sampled") from error


class SampledCampaign(PlannerResults):
    """A campaign some of whose cases were run again component by component; one that fails there has failed."""

    def __init__(self, found: FinishedCampaign, folder: Path, study: str) -> None:
        super().__init__(found, folder, study)
        self._sampled = read_sampled(folder)

    def cases(self) -> Sequence[CaseResult]:
        """Return the verdict of every finished case, and of the sampled ones as cases of their own."""
        again = [
            CaseResult(f"{self._id(self.found.cases.id(int(number)))}/data", Verdict(one["verdict"]), 0.0, one["why"])
            for number, one in self._sampled.items()
        ]
        return [*super().cases(), *again]

    def drawn(self) -> Iterator[Drawn]:
        """Yield what the cases were made of, and what they and the sampled ones met of the component model."""
        sampled = self._judged() if self._sampled else {}
        for one in super().drawn():
            yield replace(one, marks={**one.marks, **sampled})

    def _covering(self) -> set[str]:
        return super()._covering() | {"transitions"}

    def _drawn(self, facts: NDArray[np.void]) -> Drawn:
        plain, taken = super()._drawn(facts), facts["transitions"] > 0
        return replace(plain, marks={**plain.marks, "transitions taken": (TRANSITIONS, taken)})

    def _judged(self) -> Marks:
        """Return what the sampled cases met."""
        from parcours.verdict.contracts import contracts_of, judged
        from parcours_ramp.components.model import component_model

        model = component_model(self.label)
        machines = [one for component in model.components for one in component.machines]
        pairs = [f"{a.id} {b.id}" for one in machines for a in one.transitions for b in one.transitions
                 if a.target == b.source]  # fmt: skip
        met = np.array([np.isin(pairs, one["pairs"].split(", ")) for one in self._sampled.values()])
        checks = contracts_of(model).checks
        made = np.array([list(judged(checks, [one["judged"]]).values()) for one in self._sampled.values()])
        return {
            "pairs of transitions taken, judged cases": (pairs, met),
            "data oracles asked, judged cases": (checks, made),
        }

    def outline(self) -> Outline:
        """Return what a comparison needs; the sampled ones, of which no rate is known, have numbers below 0."""
        one = super().outline()
        again = np.array([-1 - int(number) for number in self._sampled], np.int64)
        passed = np.array([of["verdict"] == Verdict.PASS for of in self._sampled.values()], bool)
        unknown = np.full(len(again), -1, np.int8)

        def id(number: int) -> str:
            return one.id(number) if number >= 0 else f"{one.id(-1 - number)}/data"

        rates = {name: Counted(np.append(of.values, unknown), of.worse) for name, of in one.rates.items()}
        return Outline(np.append(one.numbers, again), id, np.append(one.passed, passed), rates)

    def case_verdicts(self) -> Sequence[Verdict]:
        """Return the verdicts of `cases`, without their reasons."""
        return [*super().case_verdicts(), *(Verdict(one["verdict"]) for one in self._sampled.values())]

    def verdict_counts(self) -> Counter[Verdict]:
        """Return how many of `cases` have each verdict."""
        return super().verdict_counts() + Counter(Verdict(one["verdict"]) for one in self._sampled.values())

    def causes(self) -> Sequence[str]:
        """Return why each of `cases` did not pass, in words that cases share."""
        passed = str(Verdict.PASS)
        again = ["" if one["verdict"] == passed else one["why"][:200] for one in self._sampled.values()]
        return [*super().causes(), *again]

    def some_cases(self, places: Sequence[int]) -> Sequence[CaseResult]:
        """Return the cases at these places."""
        n = len(self.found.facts)
        every = self.cases() if any(k >= n for k in places) else []
        return [every[k] for k in places] if every else super().some_cases(places)

    def reported(self, name: str) -> Reported:
        """Return the table of sampled cases; nothing without any."""
        rows = tuple((number, one["verdict"], one["why"]) for number, one in self._sampled.items())
        columns = Column("case"), Column("verdict"), Column("why")
        note = "Run again by components, with its latencies; messages judged by model and references, facts compared."
        tables = [Table(f"Sampled cases, {name}", columns, rows, note)] if rows else []
        return Reported(tables, lambda: tables, {})
