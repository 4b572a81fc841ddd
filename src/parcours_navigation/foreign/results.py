"""What is wanted of a run on nodes of others, what became of one case, and both of that in a folder of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from parcours.errors import BadRequest, BadResults, ParcoursError
from parcours.report.junit import CaseResult
from parcours.report.pieces import Page
from parcours.report.timings import Timed
from parcours.run.faults import FaultPlan
from parcours.study.journal import read_journal
from parcours.study.protocol import Measure
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import parse_bound
from parcours_navigation.foreign.judging import Judged


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is to be run.

    Attributes:
        cases: so many abstract cases; None for each once.
        case: the id of the only one; empty for all.
        system: so many system cases.
        repeats: so many repeats of each span that `timing` bounds and the tester can begin.
        faults: what befalls messages and components, in every case.
        record: "mcap", "bag" or empty.
        seed: of obstacles and test inputs.
        protocol: of the obstacles, or "empty".
    """

    cases: int | None = None
    case: str = ""
    system: int = 0
    repeats: int = 0
    faults: FaultPlan = field(default_factory=FaultPlan)
    record: str = ""
    seed: int = 1
    protocol: str = "table-vii"


@dataclass(frozen=True, slots=True)
class Result:
    """What became of one case, as it is kept.

    Attributes:
        kind: abstract, system or timing.
        seconds: how long it ran [s], without starting the nodes.
        recording: the file; empty if there is none.
    """

    id: str
    kind: str
    judged: Judged
    seconds: float
    recording: str = ""
    timing: Timed | None = None

    def document(self) -> dict[str, object]:
        """Return it as JSON."""
        judged = self.judged
        return {
            "id": self.id, "kind": self.kind, "verdict": str(judged.judgement.verdict), "why": judged.judgement.why,
            "outcome": judged.outcome, "seconds": round(self.seconds, 3), "deaths": dict(judged.deaths),
            "deviations": [
                {"component": one.component, "time": one.time, "rule": one.rule,
                 "expected": [str(each) for each in one.expected], "path": list(one.path[-50:]), "doubt": one.doubt}
                for one in judged.deviations
            ],
            "held_ns": list(judged.held), "recording": self.recording,
        }  # fmt: skip


def entry_of(result: Result, id: str, passive: Mapping[str, list[int]] | None = None) -> dict[str, object]:
    """Return a result as a folder keeps it.

    Args:
        result: of a case, or of a limit.
        id: by which the study knows it, without the study's name.
        passive: name of a span -> its durations in this case [ns].
    """
    timing = result.timing
    timed = {"name": timing.name, "bound": str(timing.bound), "durations": list(timing.durations)} if timing else None
    return {**result.document(), "id": id, "scene": result.id, "timing": timed, "passive": dict(passive or {})}


def result_of(entry: Mapping[str, Any], study: str) -> Result:
    """Return the result that `entry_of` kept, with the study's name in its id. Raises ValueError if it is damaged."""
    judgement = Judgement(Verdict(entry["verdict"]), str(entry["why"]))
    judged = Judged(judgement, str(entry["outcome"]), tuple(entry["deaths"].items()), (), tuple(entry["held_ns"]))
    kept = entry["timing"]
    timing = Timed(kept["name"], tuple(kept["durations"]), parse_bound(kept["bound"]), judgement) if kept else None
    id = f"{study}/{entry['id']}"
    return Result(id, str(entry["kind"]), judged, float(entry["seconds"]), str(entry["recording"]), timing)


class RosResults:
    """The results in a folder as every command wants them (`parcours.study.protocol.Results`).

    Args:
        study: its name.
        folder: that its run wrote.
        planned: how many results the last run was to have.

    Raises:
        BadResults: a line is damaged.
    """

    label = "ros1"

    def __init__(self, study: str, folder: Path, planned: int) -> None:
        self.study = study
        self.entries = list(read_journal(folder).values())
        try:
            self.found: Sequence[Result] = [result_of(entry, study) for entry in self.entries]
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

    def replay(self, case: str) -> Page:
        """Refuse: what ran in real time is judged again from its recording."""
        rule = f"case {case} ran in real time, which does not come again"
        raise BadRequest("replay", rule, "record it, and use `parcours judge`", slug="replay-live")
