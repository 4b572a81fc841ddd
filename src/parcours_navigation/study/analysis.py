"""What became of the cases of campaigns, computed once for all reports: outcomes, measures, errors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from parcours_navigation.outcomes import Outcome, Share, outcomes, published, shares
from parcours_navigation.study.campaigns import Campaign
from parcours_navigation.study.distribution import Summary, measured, oracle, summarised, survived

ASKED = 10_000
"""The earliest conceivable arrival, which SCT needs, is asked for this many first cases only."""


@dataclass(frozen=True, slots=True)
class Ended:
    """How the cases of one campaign ended."""

    label: str
    protocol: str
    seed: int
    n: int  # finished cases
    planned: int
    signals: bool  # whether the planner signals what the paper's rule asks for
    outcomes: Counter[int]  # cases of each sound outcome
    paper: dict[str, int]  # cases of each of the paper's results, by the fields of `Published`
    shares: dict[Share, int]  # cases in each slice of Fig. 5b
    measures: dict[str, Summary]  # by the names of `distribution.SHOWN`
    errors: tuple[tuple[str, int, int], ...]  # commonest first: the planner's fault, how many cases, the first of them

    def document(self) -> dict[str, object]:
        """Return all of it as JSON values; without signals, no result of the paper's that needs them."""
        ended = {o.name.lower(): self.outcomes[int(o)] for o in Outcome}
        measures = {name: asdict(one) for name, one in self.measures.items()}
        cases = {"protocol": self.protocol, "seed": self.seed, "cases": self.n, "planned": self.planned}
        first = cases | {"reached": self.paper["reached"]}
        if not self.signals:
            errors = {reason: count for reason, count, _ in self.errors}
            return {"planner": self.label, **first, "outcomes": ended, "measures": measures, "errors": errors}
        words = {"feasible": "feasible", "imminent_collision": "halted_once", "stuck": "stuck"}
        paper = {name: self.paper[field] for name, field in words.items()}
        return {"schedule": self.label, **first, **paper, "outcomes": ended, "measures": measures}


def analyse(campaigns: Mapping[str, Campaign]) -> dict[str, Ended]:
    """Return how the cases of each campaign ended; asks the oracle for what SCT needs."""
    return {name: _analysed(campaign) for name, campaign in campaigns.items()}


def _analysed(campaign: Campaign) -> Ended:
    facts, cases, flags = campaign.facts, campaign.cases, published(campaign.facts)
    earliest = np.full(len(facts), np.nan)
    earliest[:ASKED] = oracle(cases, facts["number"][:ASKED])["earliest_outer"]
    known = measured(facts, facts["measures"], earliest=earliest, survival=survived(cases, facts["number"]))
    paper = {name: int(getattr(flags, name).sum()) for name in ("reached", "feasible", "halted_once", "stuck")}
    slices = {share: int(yes.sum()) for share, yes in shares(facts).items()}
    return Ended(
        campaign.label, cases.protocol, cases.seed, len(facts), campaign.planned, campaign.signals,
        Counter(outcomes(facts).tolist()), paper, slices, summarised(known), _errors(facts),
    )  # fmt: skip


def _errors(facts: NDArray[np.void]) -> tuple[tuple[str, int, int], ...]:
    if "reason" not in (facts.dtype.names or ()):
        return ()
    failed = facts[facts["error"] != 0]
    counts = Counter(failed["reason"].tolist()).most_common()
    return tuple(
        (reason.decode("utf-8", "replace"), count, int(failed["number"][failed["reason"] == reason][0]))
        for reason, count in counts
    )
