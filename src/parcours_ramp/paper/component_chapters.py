"""Component models, paths, abstract cases and their results -> the report's chapters on section IV of the paper."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from parcours.abtc import case_counts, combinations, interaction_paths, notation, rendezvous_pairs, serialise
from parcours.model import Channel, Machine, to_svg
from parcours.paths import internal_paths, measure
from parcours.report.pieces import Cell, Code, Column, Figure, Marked, Piece, Section, Table, Text
from parcours.report.sequences import sequence_chart
from parcours.report.timings import TimingCase, timing_figure, timing_table
from parcours.study.components.results import ComponentResults, component_results, timed
from parcours.study.components.sequence import steps_to_be
from parcours.verdict.judgement import Verdict
from parcours_ramp.components.model import component_model
from parcours_ramp.components.study import CASES_OF_PAPER, LIMITS, interaction_cases, interaction_of
from parcours_ramp.paper.figures import class_table, graph_drawing, predicate_table, process_table
from parcours_ramp.paper.results import PaperResults

EXPECTED = {
    "ITP1": "10 ≤ size(trajectory) ≤ 500",
    "ITP2": "0 < fitness ≤ 2",
    "ITP3": "modified path ≠ previous path",
    "ITP4": "latest motion state ≠ null",
    "ITP5": "control ← trajectory",
    "ITP6": "latest motion state is changed",
}  # Expected results as Table VIII prints them


def models_chapter(results: PaperResults) -> Section:
    """Return the process, the six machines as drawings, Tables I and II, and the classes of messages."""
    cefsm = component_model()
    drawings: list[Piece] = []
    for component in cefsm.components:
        for machine in component.machines:
            title = component.title if len(component.machines) == 1 else f"{component.title}: {machine.name}"
            drawings.append(Figure(title, to_svg(machine), f"State machine of {title}"))
    rows = tuple((c.sender, c.receiver, c.message, c.topic, _receivers(c)) for c in cefsm.channels)
    channels = Table(
        "Table I: components, messages and channels",
        (Column("from"), Column("to"), Column("message"), Column("topic or service", code=True), Column("received by")),
        rows,
        "Table II gives `update` (p48) and the answer of Path Modification (p54) no receiver: the paper's own gap, "
        "which `parcours model check` reports as a warning. Odometry (p62) comes from outside.",
    )
    lead = (
        "RAMP's six components as communicating extended finite state machines (Fig. 3, Table II), read from a YAML "
        "file and checked. Everything below is derived from this file."
    )
    classes = class_table("Fig. 6: the classes of the messages", cefsm)
    pieces = (process_table(), *graph_drawing(results.functional), *drawings, channels, predicate_table(), classes)
    return Section("The model of RAMP's components", lead, pieces, "models")


def _receivers(channel: Channel) -> str:
    cefsm = component_model()
    if channel.receiver == "environment":
        return "environment"
    ids = [t.id for t in cefsm.component(channel.receiver).transitions() if t.event and t.event.channel == channel.name]
    return ", ".join(ids) or "nobody"


def paths_chapter() -> Section:
    """Return Table III and Table IV with the interactions found."""
    cefsm = component_model()
    paths = [
        (
            name,
            path.name,
            " ".join(path.ids),
            len(path.ids),
            measure(_machine(name, path.machine), "edge", path.ids).ratio,
        )
        for name, found in internal_paths(cefsm).items()
        for path in found
    ]
    table_iii = Table(
        "Table III: internal test paths",
        (Column("component"), Column("path", code=True), Column("transitions", code=True), Column("length"),
         Column("edges covered", ".0%")),
        tuple(paths),
        "Shortest closed paths that cover every transition (directed postman). All eight are the paper's.",
    )  # fmt: skip
    itps = interaction_paths(cefsm)
    table_iv = Table(
        "Table IV: component interaction test paths",
        (Column("path", code=True), Column("criterion"), Column("components visited")),
        tuple((i.name, i.criterion, " → ".join(i.components)) for i in itps),
        "The paper's edge-pair coverage takes one round trip per pair of components; that of Ammann and Offutt would "
        "need 24 edge pairs here. ITP5 and ITP6 are specified paths.",
    )
    pairs = Table(
        "Rendezvous", (Column("send", code=True), Column("receive", code=True), Column("channel", code=True)),
        tuple((pair.send, pair.receive, pair.channel) for pair in rendezvous_pairs(cefsm)), folded=True,
    )  # fmt: skip
    lead = "Which way through each component, and which interactions between them, the tests must take."
    return Section("Test paths", lead, (table_iii, table_iv, pairs), "paths")


def _machine(component: str, machine: str) -> Machine:
    return next(m for m in component_model().component(component).machines if m.name == machine)


def abstract_chapter() -> Section:
    """Return the combinations kept and dropped, the counts of abstract cases, and ABTC1 in the paper's notation."""
    cefsm = component_model()
    counts = case_counts(cefsm)
    rows: list[tuple[Cell, ...]] = []
    dropped: list[tuple[Cell, ...]] = []
    for itp in interaction_paths(cefsm):
        found = combinations(cefsm, itp)
        rows.append((itp.name, ", ".join(map(str, found.kept)), counts[itp.name], CASES_OF_PAPER[itp.name]))
        dropped += [
            (itp.name, str(d).split(": ", 1)[0].removeprefix(itp.name).strip(), d.reason) for d in found.dropped
        ]
    epc = sum(n for name, n in counts.items() if name in ("ITP1", "ITP2", "ITP3", "ITP4"))
    total = sum(counts.values())
    rows += [
        ("EPC", "", epc, 36),
        ("SPC", "", Marked(total - epc, "fair", "the paper says 49, but 19 + 49 is not 67"), 24),
        ("all", "", total, 60),
    ]
    table = Table(
        "Abstract behavioural test cases (ABTCs)",
        (Column("path", code=True), Column("combination kept by RCC", code=True), Column("ABTCs"),
         Column("cases in Table VIII")),
        tuple(rows),
        "The paper counts 19 for EPC, 49 for SPC and 67 in all, which does not add up; 19 + 48 = 67 does. The "
        "serialisation algorithm itself is not printed anywhere we could read: ours is a reconstruction, chosen as "
        "it gives these counts. Of eight policies of the same kind it is the only one (docs/test-generation.md).",
    )  # fmt: skip
    first = next(iter(interaction_cases().values()))
    why = Table(
        "Combinations that RCC drops, and why",
        (Column("path", code=True), Column("combination", code=True), Column("reason")), tuple(dropped), folded=True,
    )  # fmt: skip
    lead = (
        "Internal paths of the visited components are combined where they have a rendezvous, and started at every "
        "point of their partner (rendezvous serialisation). Each ABTC below was executed in exactly its order."
    )
    code = Code(notation(first, "ABTC1"), "Table V: ABTC1")
    chart = sequence_chart(
        "ABTC1 as a sequence chart", steps_to_be(cefsm, serialise(first)),
        "Each transition in its order; a message is drawn where it is taken up.",
    )  # fmt: skip
    return Section("Abstract test cases", lead, (table, code, chart, why), "abtcs")


def results_chapter(results: PaperResults) -> Section:
    """Return Table VIII with our results, and Fig. 5a."""
    by_itp: dict[str, Counter[Verdict]] = {itp: Counter() for itp in CASES_OF_PAPER}
    everything: dict[str, Counter[Verdict]] = {itp: Counter() for itp in CASES_OF_PAPER}
    sample = set(results.sample)
    for run in results.functional:
        itp = interaction_of(run.case)
        everything[itp][run.judgement.verdict] += 1
        if run.case.id in sample:
            by_itp[itp][run.judgement.verdict] += 1
    functional = Table(
        "Table VIII, functional evaluation",
        (Column("path", code=True), Column("expected result"), Column("cases", group="Table VIII"),
         Column("achieved", group="Table VIII"), Column("passed", group="the same number"),
         Column("passed", group="all ABTCs × 3 rows")),
        tuple(
            (itp, EXPECTED[itp], n, "yes", _passed(by_itp[itp]), _passed(everything[itp]))
            for itp, n in CASES_OF_PAPER.items()
        ),
        "The paper scripted 60 of its 67 N cases by hand. Each Choice over ten message blocks needs N = 3 if they "
        "belong to five parameters, which is our reading.",
    )  # fmt: skip
    failed = [run for run in results.functional if not run.judgement.passed]
    measured = component_results("here", (), results.timing)
    pieces: list[Piece] = [functional, *_timing_pieces(measured)]
    if failed:
        pieces.append(Text("\n\n".join(f"{run.case.id}: {run.judgement.why}" for run in failed[:10])))
    lead = "What the executed component cases showed, beside the paper's Table VIII."
    return Section("Component tests: results", lead, tuple(pieces), "component-results")


def _passed(counts: Counter[Verdict]) -> Cell:
    n, good = sum(counts.values()), counts[Verdict.PASS]
    return Marked(f"{good} of {n}", "good" if good == n else "bad")


def _window_table(cases: Sequence[TimingCase]) -> Table:
    """Return both readings of what Table VIII prints: a window of durations, or a range of upper limits."""
    rows: list[tuple[Cell, ...]] = []
    for itp, (low, high) in LIMITS.items():
        members = [case for case in cases if case.name == itp]
        times = np.array([duration * 1e-9 for case in members for duration in case.durations])
        passed = sum(case.judgement.passed for case in members)
        rows.append((
            itp, f"{low * 1e3:g} ms ≤ duration ≤ {high * 1e3:g} ms", float(((times >= low) & (times <= high)).mean()),
            float((times < low).mean()), f"{passed} of {len(members)}",
        ))  # fmt: skip
    return Table(
        "Table VIII, performance: the two readings",
        (Column("path", code=True), Column("as printed"), Column("inside", ".1%", group="a window"),
         Column("below it", ".1%", group="a window"), Column("cases passed", group="upper limits")),
        tuple(rows),
        "The table prints a window. The authors' public tests have upper limits only, from the greater number down to "
        "the less, and so have ours: a component that answers sooner than a window allows is no worse.",
    )  # fmt: skip


def _timing_pieces(given: ComponentResults) -> tuple[Table | Figure, ...]:
    """Return Fig. 5a and the table beside it; nothing if no case was timed."""
    cases = timed(given)
    if not cases:
        return ()
    note = (
        "Durations on the wall clock of this machine, in one process, the tester's own work included, from the first "
        "to the last event of an abstract case; warm-up left out. A verdict that noise could have made is refused. "
        "Durations are measured again in every run, so they are not part of the results that repeat bit for bit."
    )
    noise = max(given.noise.values(), key=lambda one: one.p99)
    return (
        timing_table("Table VIII, performance", cases, note),
        _window_table(cases),
        timing_figure("Fig. 5a: duration of component interactions", cases, noise),
    )
