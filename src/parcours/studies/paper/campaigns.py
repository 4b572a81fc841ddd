"""Campaign folders -> results, tables and verdicts: what `parcours report` and `parcours replay` need."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import cast

import numpy as np

from parcours.errors import BadResults
from parcours.planners.ramp.latency import Duration, Latencies
from parcours.planners.ramp.parameters import Parameters
from parcours.report.junit import CaseResult
from parcours.report.pieces import Cell, Column, Figure, Marked, Page, Piece, Section, Table
from parcours.report.rates import shares
from parcours.run.store import open_results
from parcours.studies.paper.outcomes_chapter import OUTCOME_WORDS
from parcours.studies.paper.replays_chapter import replay
from parcours.studies.paper.results import PaperResults, SystemResults
from parcours.studies.ramp_components.results import ComponentResult, component_table, functional_result, timing_result
from parcours.studies.ramp_system.cases import Protocol, SystemCases
from parcours.studies.ramp_system.facts import FACTS
from parcours.studies.ramp_system.study import SystemStudy
from parcours.verdict.navigation import VERDICT_OF, Outcome, Share, Verdict, explain, outcomes, published
from parcours.verdict.navigation import shares as slices_of
from parcours.verdict.statistics import wilson


def load_campaign(folder: Path) -> SystemResults:
    """Return the finished cases of a campaign folder, with the study that can run any of them again.

    Raises:
        BadResults: there is no campaign of system cases in the folder, or it is damaged or of another version.
    """
    store = open_results(folder)
    campaign = store.campaign
    if campaign.study != "ramp_system" or campaign.dtype.names != FACTS.names:
        raise BadResults(
            str(folder),
            f"results of ramp_system are expected, but these are of {campaign.study!r}",
            slug="results-study",
        )
    try:
        given = cast(dict[str, dict[str, object]], dict(campaign.parameters))
        latencies = Latencies(
            **{k: Duration(**v) if isinstance(v, dict) else v for k, v in given["latencies"].items()}  # type: ignore[arg-type]
        )
        radii = [float(cast(float, given[name])) for name in ("robot_radius", "obstacle_radius")]
        cases = SystemCases(campaign.seed, cast(Protocol, given["protocol"]), *radii)
        study = SystemStudy(
            cases, Parameters(**given["planner"]), latencies,  # type: ignore[arg-type]
            float(cast(float, given["time_limit"])), float(cast(float, given["watched_on"])),
        )  # fmt: skip
    except (KeyError, TypeError, ValueError) as error:
        raise BadResults(
            str(folder), f"the manifest must hold the study's parameters, but: {error}", "run the campaign anew",
            slug="results-parameters",
        ) from error  # fmt: skip
    facts = store.load(partial=True)
    finished = [n for shard in campaign.shards if shard not in set(store.missing()) for n in campaign.cases(shard)]
    if facts["number"].tolist() != finished:
        raise BadResults(
            str(folder), "shards must hold the cases that their numbers say, but do not", "run the campaign anew",
            slug="results-order",
        )  # fmt: skip
    return SystemResults(study, facts, campaign.n_cases)


def outcome_table(results: Mapping[str, SystemResults]) -> Table:
    """Return the outcomes of campaigns side by side."""
    rows: list[tuple[Cell, ...]] = [("cases", *(_finished(r) for r in results.values()))]
    for words, field in (("reached goal", "reached"), ("feasible at the end", "feasible"),
                         ("imminent collision", "halted_once"), ("stuck in imminent collision", "stuck")):  # fmt: skip
        rows.append((words, *(_share(getattr(published(r.facts), field)) for r in results.values())))
    codes = [Counter(outcomes(r.facts).tolist()) for r in results.values()]
    rows += [(OUTCOME_WORDS[o], *(count[int(o)] for count in codes)) for o in Outcome]
    for verdict in (Verdict.PASS, Verdict.FAIL, Verdict.INCONCLUSIVE):
        of = [o for o in Outcome if VERDICT_OF[o] is verdict]
        rows.append((f"verdict {verdict}", *(sum(count[int(o)] for o in of) for count in codes)))
    return Table(
        "Outcomes",
        (Column(""), *(Column(name) for name in results)),
        tuple(rows),
        "First the paper's results by its own rule, with Wilson 95 % intervals; then the sound outcomes, one a case.",
    )


def _finished(result: SystemResults) -> Cell:
    n = len(result.facts)
    return n if n == result.planned else Marked(f"{n} of {result.planned}, unfinished", "poor")


def _share(flags: np.ndarray) -> str:
    rate = wilson(int(flags.sum()), len(flags))
    return f"{rate.share:.1%} [{rate.low:.1%}, {rate.high:.1%}]"


def summary(result: SystemResults) -> dict[str, object]:
    """Return the outcomes of one campaign as JSON values."""
    facts = result.facts
    flags = published(facts)
    codes = Counter(outcomes(facts).tolist())
    return {
        "schedule": result.study.parameters.schedule,
        "protocol": result.study.cases.protocol,
        "seed": result.study.cases.seed,
        "cases": len(facts),
        "planned": result.planned,
        "reached": int(flags.reached.sum()),
        "feasible": int(flags.feasible.sum()),
        "imminent_collision": int(flags.halted_once.sum()),
        "stuck": int(flags.stuck.sum()),
        "outcomes": {o.name.lower(): codes[int(o)] for o in Outcome},
    }


def _pie(results: Mapping[str, SystemResults]) -> Figure:
    return shares(
        "How the tests ended", [str(share) for share in Share],
        {name: [int(f.sum()) for f in slices_of(r.facts).values()] for name, r in results.items()},
        ("good", "fair", "poor", "bad"),
    )  # fmt: skip


def campaigns_page(results: Mapping[str, SystemResults], components: Mapping[Path, Sequence[ComponentResult]]) -> Page:
    """Return a page on campaigns and component studies: their outcomes, and replays of two failed cases each."""
    pieces: list[Piece] = [component_table(found, f"Component cases, {name}") for name, found in components.items()]
    if results:
        pieces += [outcome_table(results), _pie(results)]
    for result in results.values():
        codes = outcomes(result.facts)
        failed = np.flatnonzero([VERDICT_OF[Outcome(int(code))] is Verdict.FAIL for code in codes])
        pieces += [replay(result, int(result.facts["number"][k])) for k in failed[:2]]
    facts = tuple((name, result.study.parameters.schedule) for name, result in results.items())
    return Page("System campaigns of RAMP", "", facts, (Section("Outcomes", "", tuple(pieces)),))


def junit_results(results: Mapping[str, SystemResults]) -> Iterable[CaseResult]:
    """Yield the sound verdict of every case, its id led by the campaign it belongs to."""
    for name, result in results.items():
        for record, code in zip(result.facts, outcomes(result.facts), strict=True):
            case = f"{name}/{result.study.cases.id(int(record['number']))}"
            yield CaseResult(case, VERDICT_OF[Outcome(int(code))], float(record["t_end"]) * 1e-9, explain(record))


def component_results(results: PaperResults) -> list[ComponentResult]:
    """Return the judged component cases, functional and timing."""
    return [*map(functional_result, results.functional), *map(timing_result, results.timing)]
