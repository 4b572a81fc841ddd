"""What became of the cases of campaigns, computed once for all reports: outcomes, measures, errors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import NDArray

from parcours.verdict.judgement import Verdict
from parcours_navigation.measures.table import MEASURES
from parcours_navigation.outcomes import VERDICT_OF, Outcome, Share, outcomes, published, shares
from parcours_navigation.requirements.judging import own_values, verdicts
from parcours_navigation.requirements.tables import Violations, violations_of
from parcours_navigation.study.campaigns import FinishedCampaign
from parcours_navigation.study.distribution import (
    SHOWN,
    MeasureSummary,
    measured,
    oracle,
    straight_ways,
    summarised,
    survived,
)

ASKED = 10_000
"""The earliest conceivable arrival, which SCT needs, and survivability are asked for this many first cases only."""

_UNREAD = (
    "x", "y", "heading", "t_end", "t_last_moving", "t_contact", "t_robot_contact", "t_shared_contact",
    "t_min_clearance", "halted_time", "n_obstacle_contacts", "n_control_cycles", "n_track",
    *(f"measures.{name}" for name in MEASURES.names or () if not (name in SHOWN and SHOWN[name].taken)
      and name != "displacement"),
)  # fmt: skip
"""Facts that no figure of a summary depends on: half of the bytes of a campaign."""


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
    measures: dict[str, MeasureSummary]  # by the names of `distribution.SHOWN`
    errors: tuple[tuple[str, int, int], ...]  # commonest first: the planner's fault, how many cases, the first of them
    required: tuple[Violations, ...] = ()  # what became of each requirement and pass rule
    judged: Counter[Verdict] | None = None  # cases of each verdict, where something is required
    first: Mapping[int, int] = field(default_factory=dict)  # the number of the first case of each sound outcome

    @property
    def verdicts(self) -> Counter[Verdict]:
        """Cases of each verdict: of the sound outcome, and of what is required beside it."""
        if self.judged is not None:
            return self.judged
        found: Counter[Verdict] = Counter()
        for code, n in self.outcomes.items():
            found[VERDICT_OF[Outcome(code)]] += n
        return found

    def document(self) -> dict[str, object]:
        """Return all of it as JSON values; without signals, no result of the paper's that needs them."""
        ended = {o.name.lower(): self.outcomes[int(o)] for o in Outcome}
        measures = {name: asdict(one) for name, one in self.measures.items()}
        cases = {"protocol": self.protocol, "seed": self.seed, "cases": self.n, "planned": self.planned}
        if not self.signals:
            errors = {reason: count for reason, count, _ in self.errors}
            found = {"planner": self.label, **cases, "outcomes": ended, "measures": measures, "errors": errors}
            return found | self._required()
        words = {"reached": "reached", "feasible": "feasible", "imminent_collision": "halted_once", "stuck": "stuck"}
        paper = {name: self.paper[field] for name, field in words.items()}
        return {"schedule": self.label, **cases, **paper, "outcomes": ended, "measures": measures} | self._required()

    def _required(self) -> dict[str, object]:
        if not self.required:
            return {}
        judged = {str(verdict): self.verdicts[verdict] for verdict in Verdict}
        return {"verdicts": judged, "requirements": [one.document() for one in self.required]}


def analyse(campaign: FinishedCampaign) -> Ended:
    """Return how the cases of a campaign ended; asks the oracle for what SCT needs.

    The facts are read part by part; at once where requirements are judged, over all cases.
    """
    cases, asked = campaign.cases, campaign.requirements
    n, ended, paper, slices, errors = 0, Counter[int](), Counter[str](), Counter[Share](), _Errors()
    known: dict[str, list[NDArray[np.float64]]] = {}
    required: tuple[Violations, ...] = ()
    own, judged = {}, None
    firsts: dict[int, int] = {}
    for facts in [campaign.facts] if asked else campaign.parts(lambda name: name not in _UNREAD):
        first = facts["number"][: max(ASKED - n, 0)]
        earliest, survival = np.full((2, len(facts)), np.nan)
        if len(first):
            earliest[: len(first)] = oracle(cases, first, inner=False)["earliest_outer"]
            survival[: len(first)] = survived(cases, first)
        straight = straight_ways(cases, facts["number"], facts["measures"])
        part = measured(facts, facts["measures"], earliest=earliest, survival=survival, straight=straight)
        for name, values in part.items():
            known.setdefault(name, []).append(values)
        flags = published(facts)
        paper.update({one: int(getattr(flags, one).sum()) for one in ("reached", "feasible", "halted_once", "stuck")})
        slices.update({share: int(yes.sum()) for share, yes in shares(facts).items()})
        codes, places, counts = np.unique(outcomes(facts), return_index=True, return_counts=True)
        ended.update(dict(zip(codes.tolist(), counts.tolist(), strict=True)))
        firsts = dict(zip(codes.tolist(), facts["number"][places].tolist(), strict=True)) | firsts
        errors.add(facts)
        n += len(facts)
        if asked:  # the only part
            own = summarised(own_values(facts, asked), {one.name: one.unit for one in asked.measures})
            required, judged = violations_of(facts, asked), Counter(verdicts(facts, asked))
    return Ended(
        campaign.label, cases.protocol, cases.seed, n, campaign.planned, campaign.signals, ended, paper, slices,
        summarised({name: np.concatenate(parts) for name, parts in known.items()}) | own,
        errors.commonest(), required, judged, firsts,
    )  # fmt: skip


class _Errors:
    """Counts the planner's own faults by their reasons, and notes a first case of each."""

    def __init__(self) -> None:
        self._counts, self._first = Counter[bytes](), dict[bytes, int]()

    def add(self, facts: NDArray[np.void]) -> None:
        """Count those of further cases."""
        if "reason" not in (facts.dtype.names or ()):
            return
        failed = facts[facts["error"] != 0]
        for reason, number in zip(failed["reason"].tolist(), failed["number"].tolist(), strict=True):
            self._counts[reason] += 1
            self._first.setdefault(reason, number)

    def commonest(self) -> tuple[tuple[str, int, int], ...]:
        """Return each reason, how many cases have it, and the first of these; the commonest first."""
        counts = self._counts.most_common()
        return tuple((reason.decode("utf-8", "replace"), n, self._first[reason]) for reason, n in counts)
