"""A folder of a campaign on system cases, as every command wants it: verdicts, measures, replays, reports."""

from __future__ import annotations

import contextlib
import functools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from parcours.errors import BadRequest, BadResults
from parcours.report.junit import CaseResult
from parcours.report.pieces import Animation, Page, Piece, Section, Table
from parcours.study.comparing import Outline, OutlinePart, outline_in_parts
from parcours.study.covering import Drawn
from parcours.study.protocol import Measure, Reported, Results
from parcours.study.reporting import replay_anchor
from parcours.study.summing import worst_cases
from parcours.study.tabling import TableColumn, field_columns, input_columns
from parcours.verdict.judgement import Verdict
from parcours_navigation.facts import FACTS, UNITS
from parcours_navigation.measures.table import METRICS
from parcours_navigation.outcomes import Outcome, outcomes
from parcours_navigation.requirements.judging import (
    PASSED,
    RATES,
    asked_of,
    counts,
    explained,
    finite_robustness,
    judged_fields,
    own_values,
    rates,
    shared_reasons,
    verdicts,
)
from parcours_navigation.requirements.requirement import NO_REQUIREMENTS, Requirements
from parcours_navigation.requirements.tables import requirement_table
from parcours_navigation.study.analysis import Ended, analyse
from parcours_navigation.study.campaigns import FinishedCampaign, case_results, load_results
from parcours_navigation.study.case_parameters import start_vectors
from parcours_navigation.study.distribution import SHOWN, measured, straight_ways
from parcours_navigation.study.outcome_tables import (
    OUTCOME_WORDS,
    error_table,
    failure_table,
    measure_table,
    outcome_figure,
    outcome_table,
)
from parcours_navigation.study.replay_picture import animation

_EDGES = (0.0, 0.05, 0.1, 0.2, 0.5)  # of bands of distance [m]
_BANDS = ("below 0 m", *(f"{low:g} to {high:g} m" for low, high in pairwise(_EDGES)), f"{_EDGES[-1]:g} m and more")
_REPLAYS = 3  # on a page on one folder

_LESS_IS_WORSE = {
    "reached",
    "min_clearance",
    "mean_clearance",
    "least_time_to_collision",
    "spl",
    "sct",
    "survivability",
    "stop_distance",
}


def _worse(name: str) -> Literal["more", "less"]:
    return "less" if name in _LESS_IS_WORSE else "more"


def measure_names(requirements: Requirements) -> tuple[str, ...]:
    """Return what `--fail-if` may ask of cases with these requirements; of SHOWN a planner gives those it can."""
    formulas = [one.name for one in requirements.formulas]
    return (*rates(np.zeros(0, FACTS), NO_REQUIREMENTS), *(f"violated({one})" for one in formulas), *SHOWN,
            *(one.name for one in requirements.measures), *(f"robustness({one})" for one in formulas))  # fmt: skip


class PlannerResults:
    """A campaign of any planner on system cases (`parcours.study.protocol.Results`); ids begin with the study."""

    def __init__(self, found: FinishedCampaign, folder: Path, study: str) -> None:
        self.found, self._folder, self._study = found, folder, study
        self.label, self.planned = found.label, found.planned

    def _id(self, of_family: str) -> str:
        return f"{self._study}/{of_family.partition('/')[2]}"

    def in_parts(self) -> Iterator[PlannerResults]:
        """Yield the results of some thousand cases after the other: a million of them need little memory."""
        for facts in self.found.parts():
            yield PlannerResults(self.found.holding(facts), self._folder, self._study)

    def cases(self) -> Sequence[CaseResult]:
        """Return the verdict of every finished case."""
        return [replace(one, id=self._id(one.id)) for one in case_results(self.found)]

    def outline(self) -> Outline:
        """Return what a comparison needs of the cases: half a dozen of the fields that are kept of each."""
        asked = self.found.requirements
        read = judged_fields(asked)

        def parts() -> Iterator[OutlinePart]:
            for facts in self.found.parts(read.__contains__):
                counted = counts(facts, asked)
                yield facts["number"].copy(), counted.pop(PASSED) == 1, counted

        return outline_in_parts(parts(), lambda number: self._id(self.found.cases.id(number)), _worse)

    @functools.cached_property
    def ended(self) -> Ended:
        """How its cases ended."""
        return analyse(self.found)

    def case_verdicts(self) -> Sequence[Verdict]:
        """Return the verdicts of `cases`, without their reasons."""
        return verdicts(self.found.facts, self.found.requirements)

    def verdict_counts(self) -> Counter[Verdict]:
        """Return how many of `cases` have each verdict."""
        return Counter(self.ended.verdicts)

    telling = ("min_clearance", "time_halted", "time_at_rest")

    def causes(self) -> Sequence[str]:
        """Return the outcome of each case that did not pass, or which requirement it violated."""
        facts, asked = self.found.facts, self.found.requirements
        words = {int(one): text for one, text in OUTCOME_WORDS.items()}
        required = shared_reasons(facts, asked)
        return [
            "" if verdict is Verdict.PASS
            else _reason(facts[k]) if code == Outcome.ERROR
            else required[k] or words[code]
            for k, (code, verdict) in enumerate(zip(outcomes(facts).tolist(), verdicts(facts, asked), strict=True))
        ]  # fmt: skip

    def some_cases(self, places: Sequence[int]) -> Sequence[CaseResult]:
        """Return the cases at these places."""
        return [replace(one, id=self._id(one.id)) for one in case_results(self.found, places)]

    def measures(self) -> Mapping[str, Measure]:
        """Return the rates of outcomes and verdicts, and what was measured on the way."""
        facts = self.found.facts
        counted = rates(facts, self.found.requirements)
        found = {name: Measure(values, worse=_worse(name)) for name, values in counted.items()}
        straight = straight_ways(self.found.cases, facts["number"], facts["measures"])
        for name, values in measured(facts, facts["measures"], straight=straight).items():
            found[name] = Measure(values, "quantity", SHOWN[name].unit, _worse(name))
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

    def drawn(self) -> Iterator[Drawn]:
        """Yield what the cases were made of: test inputs, start vectors; and their outcomes."""
        for facts in self.found.parts(self._covering().__contains__):
            yield self._drawn(facts)

    def _covering(self) -> set[str]:
        """Return the fields of facts that say what a case has covered."""
        return judged_fields(self.found.requirements) | {"min_clearance"}

    def _drawn(self, facts: NDArray[np.void]) -> Drawn:
        cases, numbers, asked = self.found.cases, facts["number"], self.found.requirements
        starts = start_vectors(cases)
        classes: dict[str, tuple[Sequence[str], NDArray[np.int64]]] = {
            "outcomes": ([one.name.lower() for one in Outcome], outcomes(facts)),
            "least clearance": (_BANDS, np.digitize(facts["min_clearance"], _EDGES)),
        }
        is_told_apart = starts != ("",)
        if is_told_apart:
            places = {start: place for place, start in enumerate(starts)}
            of = np.array([places[".".join(map(str, cases.vector(int(one))))] for one in numbers], np.int64)
            classes = {"start vectors": (starts, of), **classes}
        marks = {"requirements": asked_of(facts, asked)} if asked else {}
        return Drawn(cases.inputs, cases.values(numbers), classes, "start vectors" if is_told_apart else "", marks)

    def replays(self, most: int) -> list[Animation]:
        """Return replays of the worst cases of the commonest causes of failures, those that can be run again."""
        found: list[Animation] = []
        for id in worst_cases(self, 2 * most):
            number = self.found.cases.number(id.removesuffix("/data"))
            with contextlib.suppress(BadResults):  # it hung or died, or its planner was changed
                if number is not None and len(found) < most:
                    drawn = self.found.replay(number)
                    title = drawn.title.replace(self.found.cases.id(number), self._id(self.found.cases.id(number)))
                    found.append(replace(animation(replace(drawn, title=title)), anchor=replay_anchor(id)))
        return found

    def replay(self, case: str) -> Page:
        """Return the replay of a case: a re-simulation that must give the same bits."""
        number = self._number(case)
        drawn = self.found.replay(number)
        id = self.found.cases.id(number)
        title, subtitle = (text.replace(id, self._id(id)) for text in (drawn.title, drawn.subtitle))
        if requirements := self.found.requirements:
            (record,) = self.found.facts[self.found.facts["number"] == number]
            subtitle = f"{self._id(id)}: {explained(record, requirements)}"
        drawn = replace(drawn, title=title, subtitle=subtitle)
        section = Section(
            "Replay", "Run again from the case number: the same bits as in the campaign.", (animation(drawn),)
        )
        return Page(title, subtitle, (("folder", str(self._folder)), ("case", str(number))), (section,))

    def case(self, case: str) -> tuple[str, int]:
        """Return the id and the number of a finished case. Raises BadRequest: there is none."""
        number = self._number(case)
        return self._id(self.found.cases.id(number)), number

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


def read_folder(folder: Path, study: str) -> PlannerResults:
    """Return the results of a planner on system cases; their ids begin with `study`.

    Raises BadResults if there are none, or they are damaged.
    """
    return PlannerResults(load_results(folder), folder, study)


def report_folders(results: Mapping[str, Results]) -> Reported:
    """Return tables, pieces and documents on campaigns on system cases, and on what else reports itself."""
    campaigns = {name: one.found for name, one in results.items() if isinstance(one, PlannerResults)}
    others = [one.reported(name) for name, one in results.items() if isinstance(one, Reporting)]
    ended = {name: one.ended for name, one in results.items() if isinstance(one, PlannerResults)}
    tables: list[Table] = []
    pieces: list[Piece] = []
    if campaigns:
        errors = [table for table in [error_table(ended)] if table is not None]
        required = [
            table
            for table in [requirement_table({name: one.required for name, one in ended.items()})]
            if table is not None
        ]
        failed = [table for table in [failure_table(ended)] if table is not None]  # a page lists such cases itself
        tables = [outcome_table(ended), *required, measure_table(ended), *failed, *errors]
        pieces = [*errors, tables[0], outcome_figure(ended), *tables[1 : len(required) + 2]]
    documents: dict[str, object] = {name: one.document() for name, one in ended.items()}
    for one in others:
        tables += one.tables
        documents |= one.documents

    def drawn() -> Sequence[Piece]:
        return [*pieces, *failed_replays(results), *(piece for one in others for piece in one.pieces())]

    return Reported(tables, drawn, documents)


def failed_replays(results: Mapping[str, Results]) -> list[Piece]:
    """Return replays of the worst case of each of the commonest causes of failures: they are run again."""
    pieces: list[Piece] = []
    for one in results.values():
        if isinstance(one, PlannerResults):
            pieces += one.replays(_REPLAYS if len(results) == 1 else 1)
    return pieces


def _reason(record: np.void) -> str:
    """Return why the planner's own fault ended a case."""
    said = record["reason"].decode("utf-8", "replace") if "reason" in (record.dtype.names or ()) else ""
    return f"the planner failed: {said}" if said else "the planner failed"
