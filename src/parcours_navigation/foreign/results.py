"""What became of the cases on foreign nodes: one result each, kept in a folder of a study, and shown in tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from parcours.errors import BadRequest, BadResults, ParcoursError
from parcours.report.chains import chain_table, waterfall
from parcours.report.junit import CaseResult
from parcours.report.pieces import Cell, Column, Figure, Marked, Page, Piece, Table, Tone
from parcours.report.timings import TimingCase, timing_table
from parcours.run.binding.structure import Binding
from parcours.study.components.painting import machine_pieces
from parcours.study.components.results import ComponentResult, read_counts
from parcours.study.journal import read_journal
from parcours.study.protocol import Measure
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import Chain, parse_bound
from parcours_navigation.foreign.cases import orders_of
from parcours_navigation.foreign.judging import JudgedCase

_TONE: dict[Verdict, Tone] = {
    Verdict.PASS: "good", Verdict.FAIL: "bad", Verdict.INCONCLUSIVE: "poor", Verdict.ERROR: "worst",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Result:
    """What became of one case, or of one limit on a duration.

    Attributes:
        id: by which the study knows it, without the study's name.
        kind: abstract, system or timing.
        seconds: how long it ran [s], without starting the nodes.
        scene: the id of what was run; that of a system case names its start vector.
        recording: the file; empty if there is none.
        passive: name of a span -> its durations in this case, in shares [ns].
        chain: what `timing` is made of, if it is of a chain.
        sent: channel -> its messages in this case.
    """

    id: str
    kind: str
    judged: JudgedCase
    seconds: float
    scene: str = ""
    recording: str = ""
    timing: TimingCase | None = None
    passive: Mapping[str, Sequence[Sequence[int]]] = field(default_factory=dict)
    chain: Chain | None = None
    sent: Mapping[str, int] = field(default_factory=dict)

    def entry(self) -> dict[str, object]:
        """Return it as a folder keeps it, in JSON values."""
        judged, timing = self.judged, self.timing
        timed = timing and {"name": timing.name, "bound": str(timing.bound), "durations": list(timing.durations)}
        return {
            "id": self.id, "kind": self.kind, "verdict": str(judged.judgement.verdict), "why": judged.judgement.why,
            "outcome": judged.outcome, "seconds": round(self.seconds, 3), "deaths": dict(judged.deaths),
            "deviations": [
                {"component": one.component, "time": one.time, "rule": one.rule,
                 "expected": [str(each) for each in one.expected], "path": list(one.path[-50:]), "doubt": one.doubt}
                for one in judged.deviations
            ],
            "scheduling": dict(judged.scheduling),
            "held_ns": list(judged.held), "recording": self.recording, "scene": self.scene or self.id,
            "timing": timed, "passive": dict(self.passive), "sent": dict(self.sent),
            "chain": self.chain and {"steps": self.chain.steps, "rows": self.chain.rows},
        }  # fmt: skip


def _kept(entry: Mapping[str, Any], study: str) -> Result:
    """Return the result of an entry, with the study's name in its id. Raises ValueError if it is damaged."""
    judgement = Judgement(Verdict(entry["verdict"]), str(entry["why"]))
    judged = JudgedCase(judgement, str(entry["outcome"]), tuple(entry["deaths"].items()), (), tuple(entry["held_ns"]),
                    tuple(entry.get("scheduling", {}).items()))  # fmt: skip
    kept = entry["timing"]
    timing = TimingCase(kept["name"], tuple(kept["durations"]), parse_bound(kept["bound"]), judgement) if kept else None
    made = entry.get("chain")
    chain = Chain(kept["name"], tuple(made["steps"]), tuple(map(tuple, made["rows"]))) if made else None
    id, seconds = f"{study}/{entry['id']}", float(entry["seconds"])
    return Result(
        id, str(entry["kind"]), judged, seconds, recording=str(entry["recording"]), timing=timing, chain=chain,
        sent=read_counts(entry.get("sent", {})),
    )  # fmt: skip


class RosResults:
    """The results in a folder as every command wants them (`parcours.study.protocol.Results`).

    Args:
        study: its name.
        folder: that its run wrote.
        planned: how many results the last run was to have.
        label: the transport.

    Raises:
        BadResults: a line is damaged.
    """

    def __init__(self, study: str, folder: Path, planned: int, label: str) -> None:
        self.study, self.label = study, label
        self.entries = list(read_journal(folder).values())
        try:
            self.found = [_kept(entry, study) for entry in self.entries]
        except (KeyError, ValueError, TypeError, AttributeError, ParcoursError) as error:
            rule = f"results of cases must be readable, but: {error}"
            raise BadResults(
                str(folder), rule, "run the study again with --fresh", slug="results-components"
            ) from error
        self.planned = max(planned, len(self.found))

    def cases(self) -> Sequence[CaseResult]:
        """Return the verdict of every finished case, and of every limit."""
        return [
            CaseResult(one.id, one.judged.judgement.verdict, one.seconds, one.judged.judgement.why)
            for one in self.found
        ]

    def measures(self) -> Mapping[str, Measure]:
        """Return the rates of verdicts and deaths, and how long cases lasted [s]."""
        verdicts = [one.judged.judgement.verdict for one in self.found]

        def rate(*counted: Verdict) -> Measure:
            return Measure(np.array([one in counted for one in verdicts], float))

        return {
            "failed": rate(Verdict.FAIL, Verdict.ERROR),
            "passed": Measure(rate(Verdict.PASS).values, worse="less"),
            "inconclusive": rate(Verdict.INCONCLUSIVE),
            "deaths": Measure(np.array([bool(one.judged.deaths) for one in self.found], float)),
            "length": Measure(np.array([one.seconds for one in self.found]), "quantity", "s", ""),
        }

    def replayable(self, case: str) -> bool:
        """Return that none can be replayed."""
        return False

    def replay(self, case: str) -> Page:
        """Refuse: what ran in real time is judged again from its recording."""
        rule = f"case {case} ran in real time, which does not come again"
        raise BadRequest("replay", rule, "record it, and use `parcours judge`", slug="replay-live")


def tables(results: Sequence[Result]) -> list[Table]:
    """Return a table for each kind of case, and for the shares of each chain."""
    bare = [one for one in results if one.timing is not None and not one.timing.durations]
    timing = [one.timing for one in results if one.timing is not None and one.timing.durations]
    found = [
        _table("Abstract cases, each in its order", "case", [one for one in results if one.kind == "abstract"]),
        _table("System cases, in real time", "case", [one for one in results if one.kind == "system"]),
        timing_table("Durations between channels", timing),
        _table("Limits without durations", "limit", bare),
    ]
    found.append(_scheduling(results))
    found += [chain_table(f"Shares of {chain.name}", chain) for chain, _ in _chains(results)]
    return [table for table in found if table.rows]


def machines(results: Sequence[Result], binding: Binding, where: str) -> list[Piece]:
    """Return the components, channels and machines of the model, painted by what abstract cases took of them."""
    abstract = [one for one in results if one.kind == "abstract"]
    if not abstract:
        return []
    found, orders = [], orders_of(binding)
    for one in abstract:
        judgement = one.judged.judgement
        found.append(ComponentResult(one.id, "", str(judgement.verdict), judgement.why, sent=one.sent))
    return machine_pieces(binding.model, lambda id: orders.get(id, ()), found, where)


def waterfalls(results: Sequence[Result]) -> list[Figure]:
    """Return a drawing of each chain, with its limits."""
    return [waterfall(f"Reaction time {chain.name}", chain, limits) for chain, limits in _chains(results)]


def _chains(results: Sequence[Result]) -> list[tuple[Chain, list[int]]]:
    """Return each chain that has reactions, with its limits [ns]; results on one chain tell of the same reactions."""
    found: dict[str, tuple[Chain, list[int]]] = {}
    for one in results:
        if one.chain is not None and one.chain.rows and one.timing is not None:
            found.setdefault(one.chain.name, (one.chain, []))[1].append(one.timing.bound.limit)
    return list(found.values())


def _scheduling(results: Sequence[Result]) -> Table:
    """Return under which rules components ran that were to run in real time."""
    counts = Counter(
        (name.partition("#")[0], rule) for one in results for name, rule in dict(one.judged.scheduling).items()
    )
    rows = []
    for (name, rule), count in sorted(counts.items()):
        is_real = rule.startswith("SCHED_FIFO")
        why = "" if is_real else "not allowed here: failures that time may have caused are inconclusive"
        rows.append((name, Marked(rule, "good" if is_real else "poor", why), count, why))
    columns = Column("component", code=True), Column("ran under"), Column("cases", ",d"), Column("why")
    return Table("Real time for nodes", columns, tuple(rows))


def _table(title: str, what: str, results: Sequence[Result]) -> Table:
    columns = (Column(what, code=True), Column("verdict"), Column("length", ".2f", unit="s"), Column("why"))
    return Table(title, columns, tuple(_row(one) for one in results))


def _row(one: Result) -> tuple[Cell, ...]:
    judgement = one.judged.judgement
    return one.id, Marked(str(judgement.verdict), _TONE[judgement.verdict]), one.seconds, judgement.why
