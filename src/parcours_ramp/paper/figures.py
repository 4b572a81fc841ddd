"""The models -> Table II and Figures 1, 2, 4 and 6 of the paper."""

from __future__ import annotations

from collections.abc import Sequence

from parcours.abtc import abstract_cases, interaction_paths
from parcours.model import Cefsm, predicate
from parcours.paths import internal_paths
from parcours.report.pieces import Column, Figure, Table
from parcours.study.components.executing import Functional
from parcours.study.components.painting import channel_figure
from parcours.study.components.results import functional_result
from parcours_ramp.components.model import component_model
from parcours_ramp.components.study import component_plan


def process_table() -> Table:
    """Return Fig. 1, the steps from a model to executable cases, with what each of them gave."""
    cefsm = component_model()
    transitions = sum(1 for component in cefsm.components for _ in component.transitions())
    cases, executable = sum(1 for _ in abstract_cases(cefsm)), len(component_plan(seed=0))
    steps = (
        ("structural model", "classes of messages (Fig. 6)", f"{len(cefsm.messages)} classes"),
        (
            "behavioural model",
            "a machine for each behaviour, channels (Figs. 2, 3)",
            f"{transitions} transitions",
        ),
        ("internal test paths", "edge coverage (Table III)", f"{sum(map(len, internal_paths(cefsm).values()))} paths"),
        ("interaction test paths", "EPC and SPC (Table IV)", f"{len(interaction_paths(cefsm))} paths"),
        ("abstract test cases", "RCC and serialisation (Table V)", f"{cases} cases"),
        ("test data", "input-space partitioning, Each Choice", f"{executable // cases} rows a case"),
        ("executable test cases", "in their order, on any host (Table VIII)", f"{executable} cases"),
    )
    return Table("Fig. 1: the test generation process", (Column("step"), Column("by"), Column("gave")), steps)


def graph_drawing(functional: Sequence[Functional]) -> list[Figure]:
    """Return Fig. 2, the components and who talks to whom, with the messages that the functional cases sent."""
    return channel_figure(component_model(), [functional_result(run) for run in functional], "Fig. 2")


def predicate_table() -> Table:
    """Return Table II: every transition with its predicate."""
    rows = tuple(
        (component.title, transition.id, f"{transition.source} → {transition.target}", predicate(transition))
        for component in component_model().components
        for transition in component.transitions()
    )
    columns = (
        Column("component"), Column("transition", code=True), Column("from → to"), Column("predicate", code=True),
    )  # fmt: skip
    note = "A predicate is event/[guard]/actions/messages; a dash stands for none. Guards and payloads are spelled out."
    return Table("Table II: predicates of RAMP's machines", columns, rows, note, folded=True)


def class_table(title: str, cefsm: Cefsm) -> Table:
    """Return the classes of a structural model, a row a field."""
    rows = tuple(
        (message.name if k == 0 else "", each.name, each.type + "".join(f"[{n}]" for n in each.shape),
         "" if each.unit == "1" else each.unit)
        for message in cefsm.messages
        for k, each in enumerate(message.fields)
    )  # fmt: skip
    columns = Column("class", code=True), Column("field", code=True), Column("type", code=True), Column("unit")
    return Table(title, columns, rows, folded=True)
