"""What is wanted of a run on nodes of others, and what became of one case."""

from __future__ import annotations

from dataclasses import dataclass, field

from parcours.report.timings import Timed
from parcours.run.faults import FaultPlan
from parcours.studies.foreign.judging import Judged


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
