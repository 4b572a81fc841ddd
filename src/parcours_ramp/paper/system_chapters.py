"""System campaigns -> the report's chapters on section V of the paper: inputs, start vectors, Fig. 5c, coverage."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from parcours.data import cover
from parcours.model import to_svg
from parcours.report.distributions import histogram
from parcours.report.pieces import Cell, Column, Figure, Findings, KeyFigure, Piece, Section, Table
from parcours.report.rates import intervals
from parcours.verdict.statistics import Rate, compare_pairs, wilson
from parcours_navigation.cases.family import obstacle_model, start_cases
from parcours_navigation.cases.published import PUBLISHED, TIME_LEFT_QUANTILES
from parcours_navigation.outcomes import Outcome, outcomes, published, true_time_left
from parcours_navigation.study.analysis import analyse
from parcours_navigation.study.outcome_tables import measure_table
from parcours_ramp.components.model import component_model
from parcours_ramp.paper.figures import class_table
from parcours_ramp.paper.results import PaperResults
from parcours_ramp.system.campaigns import SystemResults
from parcours_ramp.system.ramp_facts import TRANSITIONS
from parcours_ramp.system.study import SCHEDULES

_TIME_EDGES = tuple(float(t) for t in range(0, 22, 1))


def inputs_chapter(results: PaperResults) -> Section:
    """Return the obstacle model, Table VII, the start vectors, and which blocks the drawn values really hit."""
    campaign = results.system["table-vii", "original"]
    model = campaign.study.cases.inputs
    numbers = np.arange(len(campaign.facts))
    hit = cover(model, campaign.study.cases.values(numbers))
    rows = []
    for domain, counts in zip(model.domains, hit.counts, strict=True):
        blocks = "  ".join(f"{block}: {count}" for block, count in zip(domain.blocks, counts, strict=True))
        rows.append((domain.name, str(domain.span), domain.unit, blocks))
    table = Table(
        "Table VII: input domains, blocks, and how many of the drawn values fell in each",
        (Column("input", code=True), Column("domain"), Column("unit"), Column("block: values")),
        tuple(rows),
        f"{hit.n_hit} of {hit.n_blocks} blocks hit by {hit.n_rows} cases, recomputed from the values. Every three "
        "cases of an abstract case satisfy Each Choice (12 blocks per obstacle). Obstacles stand at least 0.2 m apart "
        "and head at the robot's start. The printed domains of v and w are open, their blocks closed: the paper's "
        "inconsistency.",
    )  # fmt: skip
    vectors = Table(
        "The nine abstract cases of three obstacles",
        (Column("start vector", code=True), Column("the second obstacle starts"), Column("the third starts")),
        tuple(_spelled(case.start_vector) for case in start_cases()),
        "Rendezvous serialisation of three paths stopped → moving → stopped: 3² start vectors. The paper ran four of "
        "them, five with the simultaneous one.",
    )
    machine = obstacle_model().components[0].machines[0]
    drawing = Figure("A dynamic obstacle (Table VI)", to_svg(machine, "Obstacle"), "Obstacle: stopped, moving, stopped")
    lead = "Three obstacles stand for a second, then move and stop in an order the robot cannot foresee."
    classes = class_table("Fig. 4: the structural model of dynamic obstacles", obstacle_model())
    return Section("System tests: obstacles and test data", lead, (drawing, classes, vectors, table), "inputs")


def _spelled(vector: tuple[int, ...]) -> tuple[Cell, ...]:
    words = ("together with the one before", "while it moves", "after it has stopped")
    return ("(" + ",".join(map(str, vector)) + ")", words[vector[1] - vector[0]], words[vector[2] - vector[1]])


def headline(results: PaperResults) -> Section:
    """Return the numbers to take home."""
    original, guarded = (results.system["table-vii", s].facts for s in ("original", "guarded"))
    stuck = [wilson(int(published(f).stuck.sum()), len(f)) for f in (original, guarded)]
    goals = [wilson(int(published(f).reached.sum()), len(f)) for f in (original, guarded)]
    hit = [wilson(int((published(f).reached & (f["n_obstacle_contacts"] > 0)).sum()), g.count)
           for f, g in zip((original, guarded), goals, strict=True)]  # fmt: skip
    theirs = results.system["published", "original"].facts
    like = wilson(int(published(theirs).stuck.sum()), len(theirs))
    touched = [int((outcomes(f) == Outcome.COLLIDED).sum()) for f in (original, guarded)]
    passed = sum(run.judgement.passed for run in results.functional)
    items = (
        KeyFigure(f"{passed} / {len(results.functional)}", "component cases passed",
                "67 abstract cases × 3 rows of data, each in its serialised order",
                "good" if passed == len(results.functional) else "bad"),
        KeyFigure(_percent(stuck[0]), "stuck in imminent collision, original",
                f"published: 7.7 % of 905; under the published protocol {_percent(like)}", "bad"),
        KeyFigure(_percent(stuck[1]), "stuck, guarded", "the repaired schedule on the same cases", "good"),
        KeyFigure(f"{goals[0].share:.1%} → {goals[1].share:.1%}", "goal reached within 20 s",
                f"original → guarded; {_percent(hit[0])} → {_percent(hit[1])} of these after an obstacle had driven "
                "through the robot: obstacles are phantoms unless --solid is given"),
        KeyFigure(f"{touched[0]} → {touched[1]}", "collisions that the robot caused",
                f"of {len(original)}; the published tests had no contact oracle", "neutral"),
    )  # fmt: skip
    lead = (
        "The study of Abdelgawad, McLeod, Andrews and Xiao, repeated automatically on a complete RAMP: components "
        "tested in every interleaving their model asks for, then the whole robot among moving obstacles. `original` "
        "follows the published schedule; `guarded` is its repair."
    )
    return Section("What came out", lead, (Findings(items),), "summary")


def _percent(rate: Rate) -> str:
    return f"{rate.share:.1%}"


def vectors_chapter(results: PaperResults) -> Section:
    """Return the rates per start vector for both schedules with the published ones, and the repair on pairs."""
    vectors = sorted({case.start_vector for case in start_cases()})
    names = ["(" + ",".join(map(str, v)) + ")" for v in vectors]
    pieces: list[Piece] = []
    for words, field in (("stuck in imminent collision", "stuck"), ("reached goal", "reached")):
        rates: dict[str, list[Rate | None]] = {}
        for schedule in ("original", "guarded"):
            campaign = results.system["table-vii", schedule]
            flags = getattr(published(campaign.facts), field)
            rates[schedule] = [_rate(flags[_of_vector(campaign, v)]) for v in vectors]
        rates["published"] = [_published_rate(v, field) for v in vectors]
        pieces.append(intervals(f"{words.capitalize()}, by start vector", names, rates, f"share of tests: {words}"))
    pieces.append(_repair_table(results))
    pieces.append(_folder_table(results))
    lead = "The nine orders in which three obstacles can set out, and what the repair changes, case by case."
    return Section("System tests: start vectors and repair", lead, tuple(pieces), "vectors")


def _of_vector(campaign: SystemResults, vector: tuple[int, ...]) -> NDArray[np.bool_]:
    return np.array([campaign.study.cases.vector(int(n)) == vector for n in campaign.facts["number"]])


def _rate(flags: NDArray[np.bool_]) -> Rate | None:
    return wilson(int(flags.sum()), len(flags)) if len(flags) else None


def _published_rate(vector: tuple[int, ...], field: str) -> Rate | None:
    runs = [r for r in PUBLISHED if r.vector == vector]
    return wilson(sum(getattr(r, field) for r in runs), sum(r.n for r in runs)) if runs else None


def _repair_table(results: PaperResults) -> Table:
    original, guarded = (results.system["table-vii", s].facts for s in ("original", "guarded"))
    flags: dict[str, Callable[[NDArray[np.void]], NDArray[np.bool_]]] = {
        "stuck in imminent collision (published rule)": lambda f: published(f).stuck,
        "stopped for good": lambda f: outcomes(f) == Outcome.STUCK,
        "collision caused by the robot": lambda f: outcomes(f) == Outcome.COLLIDED,
        "reached goal in time": lambda f: published(f).reached,
        "pass": lambda f: np.isin(outcomes(f), [int(Outcome.REACHED), int(Outcome.UNDER_WAY)]),
    }
    rows: list[tuple[Cell, ...]] = []
    for words, rule in flags.items():
        pairs = compare_pairs(rule(original), rule(guarded))
        rows.append((words, pairs.both, pairs.first_only, pairs.second_only, pairs.neither, pairs.p_value))
    return Table(
        "The repair on the same cases: original against guarded",
        (Column("result"), Column("both"), Column("only original"), Column("only guarded"), Column("neither"),
         Column("p (exact McNemar)", ".2g")),
        tuple(rows),
    )  # fmt: skip


def _folder_table(results: PaperResults) -> Table:
    """Return the published folders beside the same protocol here."""
    campaign = results.system["published", "original"]
    rows: list[tuple[Cell, ...]] = []
    start = 0
    for runs in PUBLISHED:
        facts = campaign.facts[start : start + runs.n]
        start += runs.n
        if len(facts) == 0:
            continue
        ours = published(facts)
        delays = ", ".join(f"{d:g}" for d in runs.delays)
        rows.append(
            (runs.folder, delays, runs.n, runs.reached / runs.n, float(ours.reached.mean()), runs.halted / runs.n,
             float(ours.halted_once.mean()), runs.stuck / runs.n, float(ours.stuck.mean()))
        )  # fmt: skip
    pairs = [
        Column(n, ".0%", group=g)
        for g in ("reached goal", "imminent collision", "stuck")
        for n in ("published", "ours")
    ]
    return Table(
        "The authors' eight folders of raw results, and the same protocol with the original schedule",
        (Column("folder"), Column("delays", unit="s"), Column("tests"), *pairs), tuple(rows),
        "Folder 1 (16 % reached) looks like an earlier build of the published system.", folded=True,
    )  # fmt: skip


def time_left_chapter(results: PaperResults) -> Section:
    """Return Fig. 5c: time left by the published rule, and the true remaining time."""
    series = {s: published(results.system["table-vii", s].facts).time_left for s in ("original", "guarded")}
    figure = histogram(
        "Fig. 5c: time left on feasible trajectories, by the published rule", series, _TIME_EDGES,
        "time stamp of the last sample of the last feasible trajectory [s]", {"published": TIME_LEFT_QUANTILES},
        "The published rule reads the generated part of the trajectory only, which ends at the first sharp corner: it "
        "is not the time to the goal.",
    )  # fmt: skip
    late = {}
    for schedule in ("original", "guarded"):
        facts = results.system["table-vii", schedule].facts
        times = true_time_left(facts)
        late[schedule] = times[times > 0.0]
    true = histogram(
        "True remaining time of the cases that arrived late", late, tuple(float(t) for t in range(0, 42, 2)),
        "time from the end of the test to the goal [s]",
    )  # fmt: skip
    lead = "How much was left to do for the robots that had not arrived when the test ended."
    return Section("System tests: remaining time", lead, (figure, true), "time-left")


def measures_chapter(results: PaperResults) -> Section:
    """Return how the robots drove: what was measured beside the verdicts, for both schedules on the same cases."""
    campaigns = {schedule: results.system["table-vii", schedule] for schedule in SCHEDULES}
    lead = "What was measured of each case beside its verdict; docs/metrics.md defines every measure."
    return Section(
        "System tests: measures",
        lead,
        (measure_table({name: analyse(one) for name, one in campaigns.items()}),),
        "measures",
    )


def coverage_chapter(results: PaperResults) -> Section:
    """Return how often each transition of the model was taken in the real runs."""
    rows: list[tuple[Cell, ...]] = []
    totals = {s: results.system["table-vii", s].facts["transitions"].sum(axis=0) for s in ("original", "guarded")}
    cefsm = component_model()
    taken = Counter(e.transition for run in results.functional for e in run.execution.trace.events if e.kind == "take")
    for k, name in enumerate(TRANSITIONS):
        component, _, transition = cefsm.transition(name)
        arrow = f"{transition.source} → {transition.target}"
        rows.append((name, component.title, arrow, *(int(totals[s][k]) for s in totals), taken[name]))
    covered = {s: int((counts > 0).sum()) for s, counts in totals.items()}
    together = sum(taken[name] > 0 or totals["original"][k] > 0 for k, name in enumerate(TRANSITIONS))
    table = Table(
        "Transitions taken in the system campaigns",
        (Column("transition", code=True), Column("component"), Column("from → to"),
         *(Column(s, ",d") for s in totals), Column("component cases", ",d")),
        tuple(rows),
        "p14, p21, p31, p51 and p61 are polls that find nothing; the system campaigns are driven by events and never "
        "poll, the component cases do.",
        folded=True,
    )  # fmt: skip
    lead = (
        "In component cases every component names the transition it takes. The compiled loop of the campaigns counts "
        "them by hand, where its kernels do the same; tests compare the counts with traces of the component form, "
        "without latencies. "
        f"{covered['original']} of {len(TRANSITIONS)} transitions in the original campaign, "
        f"{covered['guarded']} in the guarded one, {together} together with the component cases."
    )
    return Section("Model coverage reached in the runs", lead, (table,), "coverage")
