"""A campaign on system cases -> the rates and measures that a gate can ask for."""

from __future__ import annotations

import numpy as np

from parcours.study.protocol import Measure
from parcours.verdict.judgement import Verdict
from parcours_navigation.outcomes import VERDICT_OF, Outcome, outcomes
from parcours_navigation.study.distribution import SHOWN, measured
from parcours_navigation.study.outcome_tables import Results

_RATES = {
    "contacts": Outcome.COLLIDED,
    "reached": Outcome.REACHED,
    "late": Outcome.UNDER_WAY,
    "blocked": Outcome.BLOCKED,
    "stuck": Outcome.STUCK,
    "astray": Outcome.ASTRAY,
    "errors": Outcome.ERROR,
}
_WORSE_LESS = (
    "min_clearance",
    "mean_clearance",
    "least_time_to_collision",
    "spl",
    "sct",
    "survivability",
    "stop_distance",
)


def measures_of(found: Results) -> dict[str, Measure]:
    """Return the rates of outcomes and verdicts, and what was measured on the way."""
    facts = found.facts
    codes = outcomes(facts)
    verdicts = np.array([VERDICT_OF[Outcome(int(code))] for code in codes], object)
    measures = {
        name: Measure((codes == int(outcome)).astype(float), worse="less" if name == "reached" else "more")
        for name, outcome in _RATES.items()
    }
    measures["failed"] = Measure(np.isin(verdicts, [Verdict.FAIL, Verdict.ERROR]).astype(float))
    for name, values in measured(facts, facts["measures"]).items():
        worse = "less" if name in _WORSE_LESS else "more"
        measures[name] = Measure(values, "quantity", SHOWN[name].unit, worse)  # type: ignore[arg-type]
    return measures
