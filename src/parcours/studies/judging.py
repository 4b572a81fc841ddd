"""One case of any study -> executed anew and judged, with what a reader needs to believe the verdict."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NoReturn

from parcours.errors import BadRequest, BadSuite, require_known
from parcours.studies import check_study
from parcours.suite import Case
from parcours.verdict.judgement import Verdict

if TYPE_CHECKING:
    import numpy as np


_WIDTH = 110
"""Where the lines of an explanation are broken [characters]."""


@dataclass(frozen=True, slots=True)
class Judged:
    """One case, executed and judged.

    Attributes:
        case: what was executed.
        verdict: what the study's oracle says.
        why: its reason, one sentence.
        facts: what the oracle looked at, as (name, value with unit).
        replay: a command that shows the run.
    """

    case: Case
    verdict: Verdict
    why: str
    facts: tuple[tuple[str, str], ...]
    replay: str

    def __str__(self) -> str:
        values = [f"{name} = {value:g}" for name, value in zip(self.case.names, self.case.values, strict=True)]
        facts = [f"{name} = {value}" for name, value in self.facts]
        paragraphs = ("case", [self.case.id]), ("values", values), ("facts", facts)
        lines = [f"{self.verdict}: {self.why}"]
        for head, parts in paragraphs:
            text = f"  {head:<7} {', '.join(parts)}"
            lines += textwrap.wrap(text, _WIDTH, subsequent_indent=" " * 10, break_long_words=False)
        return "\n".join([*lines, f"  replay  {self.replay}"])


def judge_case(case: Case, *, schedule: str = "") -> Judged:
    """Execute one case in simulated time and judge it.

    Args:
        case: of a study that ships with Parcours, as its plan or a suite file holds it.
        schedule: of ramp_system: original (if empty) or guarded.

    Raises:
        BadRequest: the study or the schedule is unknown, or the study has no schedules.
        BadSuite: the study has no such case, or the values are not those that its number and seed give.

    >>> from parcours.studies import suite_of
    >>> judged = judge_case(next(suite_of("ramp_components", seed=1)))
    >>> judged.verdict.value, judged.case.id
    ('pass', 'ramp_components/ITP1-tp12.tp21.tp12-0.0.0/0')
    """
    check_schedule(case.study, schedule)
    return _system(case, schedule or "original") if case.study == "ramp_system" else _component(case)


def check_schedule(study: str, schedule: str) -> None:
    """Raise BadRequest unless `study` is one, and has that schedule; an empty one is the study's own choice."""
    check_study(study)
    if not schedule:
        return
    if study != "ramp_system":
        rule = f"it belongs to ramp_system, but the study is {study}"
        raise BadRequest("schedule", rule, "leave it out", slug="option-study")
    from parcours.studies.ramp_system.study import SCHEDULES

    require_known(schedule, SCHEDULES, "schedule", slug="unknown-schedule")


def _component(case: Case) -> Judged:
    from parcours.run.trace import transitions
    from parcours.studies.ramp_components.study import interaction_cases, run_functional

    if case.abstract not in interaction_cases():
        _unknown(case, "no abstract case of ramp_components is called like that")
    run = run_functional(case)
    taken = transitions(run.execution.trace)
    facts = (("interaction", case.abstract.partition("-")[0]), ("taken", " ".join(taken)))
    replay = f"parcours abtc src/parcours/studies/ramp_components/model.yaml --case {case.abstract}"
    return Judged(case, run.judgement.verdict, run.judgement.why, facts, replay)


def _system(case: Case, schedule: str) -> Judged:
    import numpy as np

    from parcours.studies.ramp_system.study import system_study
    from parcours.verdict.navigation import VERDICT_OF, Outcome, explain, outcomes

    protocol = "published" if case.abstract.startswith("published-") else "table-vii"
    study = replace(system_study(schedule, seed=case.seed, protocol=protocol), time_limit=case.time_budget)  # type: ignore[arg-type]
    numbers = np.array([case.number])
    if case.id != study.cases.id(case.number) or case.names != study.cases.inputs.names:
        _unknown(case, f"case {case.number} of seed {case.seed} is {study.cases.id(case.number)}")
    if case.values != tuple(study.cases.values(numbers)[0].tolist()):
        _unknown(case, f"its number and its seed {case.seed} give other values")
    facts = study.run(numbers)
    code = Outcome(int(outcomes(facts)[0]))
    command = f"parcours run ramp_system --schedule {schedule} --protocol {protocol} --seed {case.seed}"
    replay = f"{command} --cases {case.number + 1} --out out && parcours replay out {case.number} --html replay.html"
    return Judged(case, VERDICT_OF[code], explain(facts[0]), _shown(facts[0]), replay)


def _shown(record: np.void) -> tuple[tuple[str, str], ...]:
    """Return the judge's facts: times in seconds, lengths in metres."""
    from parcours.verdict.facts import FACTS, NEVER

    shown = []
    for name in FACTS.names or ():
        value = record[name].item()
        if name.startswith("t_") or name == "halted_time":
            text = "never" if value == NEVER else f"{value * 1e-9:.3f} s"
        else:
            text = f"{value:.4g}"
        shown.append((name, text))
    return tuple(shown)


def _unknown(case: Case, why: str) -> NoReturn:
    rule = f"a case must be one that the study has, but {why}"
    raise BadSuite(f"case {case.id!r}", rule, "write the suite anew with this version", slug="foreign-case")
