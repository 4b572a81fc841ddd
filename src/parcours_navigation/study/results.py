"""A folder of a campaign on system cases -> its results, as every command wants them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

from parcours.errors import BadRequest
from parcours.report.junit import CaseResult
from parcours.report.pieces import Page, Piece, Section, Table
from parcours.study.protocol import Measure, Reported, Results
from parcours_navigation.study.outcome_tables import Results as Campaign
from parcours_navigation.study.still import animation


class CampaignResults:
    """A campaign of any planner on system cases, as every command wants it (`parcours.study.protocol.Results`).

    Args:
        found: the campaign.
        folder: where it lies.
        study: name of the study, with which ids begin.
    """

    def __init__(self, found: Campaign, folder: Path, study: str) -> None:
        self.found, self._folder, self._study = found, folder, study
        self.label, self.planned = self.found.label, self.found.planned

    def cases(self) -> Sequence[CaseResult]:
        """Return the verdict of every finished case."""
        from parcours_navigation.study.campaigns import case_results

        listed = case_results(self.found)
        return [dataclasses.replace(one, id=f"{self._study}/{one.id.partition('/')[2]}") for one in listed]

    def measures(self) -> Mapping[str, Measure]:
        """Return the rates of outcomes, and the measures of the tracks."""
        from parcours_navigation.study.gates import measures_of

        return measures_of(self.found)

    def replay(self, case: str) -> Page:
        """Return the replay of a case: a re-simulation that must give the same bits."""
        number = self._number(case)
        drawn = self.found.replay(number)
        id = self.found.cases.id(number)
        ours = f"{self._study}/{id.partition('/')[2]}"
        drawn = dataclasses.replace(
            drawn, title=drawn.title.replace(id, ours), subtitle=drawn.subtitle.replace(id, ours)
        )
        section = Section(
            "Replay", "Run again from the case number: the same bits as in the campaign.", (animation(drawn),)
        )
        return Page(drawn.title, drawn.subtitle, (("folder", str(self._folder)), ("case", str(number))), (section,))

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
    """Return the results of system cases in a folder: a campaign of any planner.

    Args:
        folder: of results.
        study: name of the study, with which ids begin.

    Raises:
        BadResults: there are none, or they are damaged.
    """
    from parcours_navigation.study.campaigns import load_results

    return CampaignResults(load_results(folder), folder, study)


def report_folders(results: Mapping[str, Results]) -> Reported:
    """Return tables, pieces and documents on campaigns on system cases, and on what else reports itself."""
    from parcours_navigation.study.campaigns import campaign_pieces, error_table, measure_table, summary
    from parcours_navigation.study.outcome_tables import outcome_table

    campaigns = {name: one.found for name, one in results.items() if isinstance(one, CampaignResults)}
    others = [one.reported(name) for name, one in results.items() if isinstance(one, Reporting)]
    tables: list[Table] = []
    first: list[Piece] = []
    documents: dict[str, object] = {}
    if campaigns:
        errors = error_table(campaigns)
        first = [errors] if errors is not None else []
        tables += [outcome_table(campaigns), measure_table(campaigns), *([errors] if errors is not None else [])]
        documents |= {name: summary(campaign) for name, campaign in campaigns.items()}
    for one in others:
        tables += one.tables
        documents |= one.documents
    last = [piece for one in others for piece in one.pieces()]
    return Reported(tables, lambda: [*first, *campaign_pieces(campaigns), *last], documents)
