"""A folder of a campaign on system cases, as every command wants it: verdicts, measures, replays, reports."""

from __future__ import annotations

import dataclasses
import functools
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from parcours.errors import BadRequest
from parcours.report.junit import CaseResult
from parcours.report.pieces import Page, Piece, Section, Table
from parcours.study.covering import Drawn
from parcours.study.protocol import Measure, Reported, Results
from parcours.study.tabling import TableColumn, field_columns, input_columns
from parcours.verdict.judgement import Verdict
from parcours_navigation.cases.family import PUBLISHED_CASES
from parcours_navigation.facts import UNITS
from parcours_navigation.measures.table import METRICS
from parcours_navigation.outcomes import Outcome, outcomes
from parcours_navigation.requirements.judging import RATES, explained, finite_robustness, own_values, rates, verdicts
from parcours_navigation.requirements.tables import requirement_table
from parcours_navigation.study.analysis import Ended, analyse
from parcours_navigation.study.campaigns import Campaign, case_results, load_results
from parcours_navigation.study.distribution import SHOWN, measured, straight_ways
from parcours_navigation.study.outcome_tables import error_table, measure_table, outcome_figure, outcome_table
from parcours_navigation.study.still import animation

_LESS_IS_WORSE = {
    "min_clearance",
    "mean_clearance",
    "least_time_to_collision",
    "spl",
    "sct",
    "survivability",
    "stop_distance",
}


class CampaignResults:
    """A campaign of any planner on system cases (`parcours.study.protocol.Results`); ids begin with the study."""

    def __init__(self, found: Campaign, folder: Path, study: str) -> None:
        self.found, self._folder, self._study = found, folder, study
        self.label, self.planned = found.label, found.planned

    def _id(self, of_family: str) -> str:
        return f"{self._study}/{of_family.partition('/')[2]}"

    def cases(self) -> Sequence[CaseResult]:
        """Return the verdict of every finished case."""
        return [dataclasses.replace(one, id=self._id(one.id)) for one in case_results(self.found)]

    @functools.cached_property
    def ended(self) -> Ended:
        """How its cases ended."""
        return analyse(self.found)

    def verdict_counts(self) -> Counter[Verdict]:
        """Return how many of `cases` have each verdict."""
        return Counter(self.ended.verdicts)

    def measures(self) -> Mapping[str, Measure]:
        """Return the rates of outcomes and verdicts, and what was measured on the way."""
        facts = self.found.facts
        counted = rates(facts, self.found.requirements)
        found = {
            name: Measure(values, worse="less" if name == "reached" else "more") for name, values in counted.items()
        }
        straight = straight_ways(self.found.cases, facts["number"], facts["measures"])
        for name, values in measured(facts, facts["measures"], straight=straight).items():
            worse = "less" if name in _LESS_IS_WORSE else "more"
            found[name] = Measure(values, "quantity", SHOWN[name].unit, worse)  # type: ignore[arg-type]
        for name, values in own_values(facts, self.found.requirements).items():
            units = {one.name: one.unit for one in self.found.requirements.measures}
            found[name] = Measure(np.where(np.isfinite(values), values, np.nan), "quantity", units[name], "more")
        values = finite_robustness(facts, self.found.requirements)
        for k, one in enumerate(self.found.requirements.formulas):
            found[f"robustness({one.name})"] = Measure(values[:, k], "quantity", one.unit, "less")
        return found

    def table_columns(self) -> Mapping[str, TableColumn]:
        """Return what is known of the cases: ids, start vectors, outcomes, facts, test inputs and their blocks."""
        facts, cases = self.found.facts, self.found.cases
        numbers = facts["number"]
        words = np.array([one.name.lower() for one in Outcome])
        found = {
            "case": TableColumn(lambda: np.array([self._id(cases.id(int(number))) for number in numbers])),
            "planner": TableColumn(lambda: np.full(len(facts), self.label)),
            "start": TableColumn(lambda: np.array([".".join(map(str, cases.vector(int(n)))) for n in numbers])),
            "verdict": TableColumn(lambda: np.array([str(one) for one in verdicts(facts, self.found.requirements)])),
            "outcome": TableColumn(lambda: words[outcomes(facts)]),
        }
        # of what `measures` calls by the same name, that is meant: its path_length is not the sum of the track's chords
        found |= field_columns(facts, UNITS | {one.name: one.unit for one in METRICS}, tuple(SHOWN))
        return found | input_columns(cases.inputs, lambda: cases.values(numbers), {*found, *SHOWN, *RATES, "failed"})

    def drawn(self) -> Drawn:
        """Return what the cases were made of: test inputs, start vectors; and their outcomes."""
        cases, numbers = self.found.cases, self.found.facts["number"]
        of = np.array([".".join(map(str, cases.vector(int(number)))) for number in numbers], str)
        starts = tuple(dict.fromkeys(".".join(map(str, cases.vector(number))) for number in range(PUBLISHED_CASES)))
        words = [one.name.lower() for one in Outcome]
        classes = {"outcomes": (words, np.array(words)[outcomes(self.found.facts)])}
        if starts != ("",):
            return Drawn(
                cases.inputs, cases.values(numbers), {"start vectors": (starts, of), **classes}, "start vectors"
            )
        return Drawn(cases.inputs, cases.values(numbers), classes)

    def replay(self, case: str) -> Page:
        """Return the replay of a case: a re-simulation that must give the same bits."""
        number = self._number(case)
        drawn = self.found.replay(number)
        id = self.found.cases.id(number)
        title, subtitle = (text.replace(id, self._id(id)) for text in (drawn.title, drawn.subtitle))
        if requirements := self.found.requirements:
            (record,) = self.found.facts[self.found.facts["number"] == number]
            subtitle = f"{self._id(id)}: {explained(record, requirements)}"
        drawn = dataclasses.replace(drawn, title=title, subtitle=subtitle)
        section = Section(
            "Replay", "Run again from the case number: the same bits as in the campaign.", (animation(drawn),)
        )
        return Page(title, subtitle, (("folder", str(self._folder)), ("case", str(number))), (section,))

    def _number(self, case: str) -> int:
        number, finished = self.found.cases.number(case), self.found.facts["number"]
        if number is not None and number in finished:
            return number
        rule = f"the campaign has cases 0 .. {self.planned - 1}, but case {case} was asked for"
        if number is not None and number < self.planned:
            rule = f"{len(finished) or 'no'} of {self.planned} cases are finished, and case {case} is not yet"
        if not len(finished):
            rule = f"no case is finished yet, but case {case} was asked for"
        raise BadRequest("replay", rule, "run the campaign on, or name another case", slug="case-number")


@runtime_checkable
class Reporting(Protocol):
    """Results of another form, beside campaigns in the same report."""

    def reported(self, name: str) -> Reported:
        """Return what a report says of them under that name."""


def read_folder(folder: Path, study: str) -> CampaignResults:
    """Return the results of a planner on system cases; their ids begin with `study`.

    Raises BadResults if there are none, or they are damaged.
    """
    return CampaignResults(load_results(folder), folder, study)


def report_folders(results: Mapping[str, Results]) -> Reported:
    """Return tables, pieces and documents on campaigns on system cases, and on what else reports itself."""
    campaigns = {name: one.found for name, one in results.items() if isinstance(one, CampaignResults)}
    others = [one.reported(name) for name, one in results.items() if isinstance(one, Reporting)]
    ended = {name: one.ended for name, one in results.items() if isinstance(one, CampaignResults)}
    tables: list[Table] = []
    pieces: list[Piece] = []
    if campaigns:
        errors = [table for table in [error_table(ended)] if table is not None]
        required = [
            table
            for table in [requirement_table({name: one.required for name, one in ended.items()})]
            if table is not None
        ]
        tables = [outcome_table(ended), *required, measure_table(ended), *errors]
        pieces = [*errors, tables[0], outcome_figure(ended), *tables[1 : len(required) + 2]]
    documents: dict[str, object] = {name: one.document() for name, one in ended.items()}
    for one in others:
        tables += one.tables
        documents |= one.documents

    def drawn() -> Sequence[Piece]:
        return [*pieces, *failed_replays(campaigns), *(piece for one in others for piece in one.pieces())]

    return Reported(tables, drawn, documents)


def failed_replays(campaigns: Mapping[str, Campaign]) -> list[Piece]:
    """Return replays of the first two failed cases of each campaign: they are run again."""
    pieces: list[Piece] = []
    for campaign in campaigns.values():
        judged = verdicts(campaign.facts, campaign.requirements)
        failed = np.array([one is Verdict.FAIL for one in judged], bool)
        pieces += [animation(campaign.replay(int(number))) for number in campaign.facts["number"][failed][:2]]
    return pieces
