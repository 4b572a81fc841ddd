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
    """How the cases of one campaign ended.

    Attributes:
        label, protocol, seed: what ran.
        n, planned: finished cases, and cases planned.
        signals: whether the planner signals what the paper's rule asks for.
        outcomes: cases of each sound outcome.
        paper: cases of each of the paper's results, by the fields of `Published`.
        shares: cases in each slice of Fig. 5b.
        measures: by the names of `distribution.SHOWN`.
        errors: what the planner itself did wrong, commonest first: the reason, how many cases, the first of them.
    """

    label: str
    protocol: str
    seed: int
    n: int
    planned: int
    signals: bool
    outcomes: Counter[int]
    paper: dict[str, int]
    shares: dict[Share, int]
    measures: dict[str, Summary]
    errors: tuple[tuple[str, int, int], ...]

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
    facts = campaign.facts
    flags = published(facts)
    earliest = np.full(len(facts), np.nan)
    earliest[:ASKED] = oracle(campaign.cases, facts["number"][:ASKED])["earliest_outer"]
    survival = survived(campaign.cases, facts["number"])
    return Ended(
        campaign.label,
        campaign.cases.protocol,
        campaign.cases.seed,
        len(facts),
        campaign.planned,
        campaign.signals,
        Counter(outcomes(facts).tolist()),
        {name: int(getattr(flags, name).sum()) for name in ("reached", "feasible", "halted_once", "stuck")},
        {share: int(yes.sum()) for share, yes in shares(facts).items()},
        summarised(measured(facts, facts["measures"], earliest=earliest, survival=survival)),
        _errors(facts),
    )


def _errors(facts: NDArray[np.void]) -> tuple[tuple[str, int, int], ...]:
    if "reason" not in (facts.dtype.names or ()):
        return ()
    failed = facts[facts["error"] != 0]
    counts = Counter(failed["reason"].tolist()).most_common()
    return tuple(
        (reason.decode("utf-8", "replace"), count, int(failed["number"][failed["reason"] == reason][0]))
        for reason, count in counts
    )
