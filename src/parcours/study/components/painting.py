"""Paints the machines and channels of a model by what became of the cases that took them: drawings and a table."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from parcours.abtc import MARK, Event
from parcours.model.picture import Paint, PaintState, channels_to_svg, to_svg
from parcours.model.structure import Cefsm, Machine
from parcours.report.pieces import Cell, Column, Figure, Marked, Piece, Table, Tone, plain_anchor

if TYPE_CHECKING:
    from parcours.study.components.results import ComponentResult

OrderOf = Callable[[str], Sequence[Event]]
"""The events of an abstract case in their order, by its id; none if the model has no such case."""

Place = tuple[str, str]  # a component and the id of a transition of it

_TONES: dict[PaintState, Tone] = {"covered": "good", "uncovered": "poor", "infeasible": "neutral", "failing": "bad"}
_NAMED = 3  # cases that took a transition: the first that failed, and others
_EXPECTED = re.compile(r"event \d+, ([^#\s]+)#\d+: expected (\S+?),")  # as the order of a case is found broken


@dataclass(slots=True)
class TransitionCases:
    """What became of the cases that took a transition."""

    passed: int = 0
    failed: int = 0
    failing: list[str] = field(default_factory=list)  # ids, the first of them
    passing: list[str] = field(default_factory=list)
    broke: bool = False  # whether a case was to take it and did not


def taken_by(order_of: OrderOf, results: Sequence[ComponentResult]) -> Mapping[Place, TransitionCases]:
    """Return what became of the functional cases that were to take each transition; a passing case has taken it."""
    found: dict[Place, TransitionCases] = {}
    cases: dict[str, list[ComponentResult]] = {}
    for one in results:
        if not one.bound and one.verdict != "inconclusive":
            cases.setdefault(one.id.split("/")[1].partition(MARK)[0], []).append(one)
    for abstract, mine in cases.items():
        verdicts = Counter(one.verdict == "pass" for one in mine)
        named = {good: [one.id for one in mine if (one.verdict == "pass") is good][:_NAMED] for good in (True, False)}
        for place in {(event.component, event.transition) for event in order_of(abstract)}:
            at = found.setdefault(place, TransitionCases())
            at.passed += verdicts[True]
            at.failed += verdicts[False]
            at.passing += named[True][: _NAMED - len(at.passing)]
            at.failing += named[False][: _NAMED - len(at.failing)]
        for one in mine:
            broken = _EXPECTED.search(one.why) if one.verdict != "pass" else None
            if broken and (broken[1], broken[2]) in found:
                found[broken[1], broken[2]].broke = True
    return found


def channel_figure(model: Cefsm, results: Sequence[ComponentResult], where: str) -> list[Figure]:
    """Return the components and channels of a model with the messages that its cases sent; nothing if none is known."""
    counted = [one.sent for one in results if one.sent]
    if not counted or not model.channels:
        return []
    sums: Counter[str] = Counter()
    for sent in counted:
        sums.update(sent)
    rates = {channel: count / len(counted) for channel, count in sums.items()}
    said = ", ".join(
        f"{one.name} from {one.sender} to {one.receiver} {rates.get(one.name, 0.0):.3g}" for one in model.channels
    )
    title = f"Components and channels, {where}"
    note = (
        f"Messages a case, counted in the traces of {len(counted):,d} cases, the tester's included. Dashed: no message."
    )
    return [Figure(title, lambda: channels_to_svg(model, title, rates), f"Messages a case: {said}", note)]


def transition_states(
    model: Cefsm, order_of: OrderOf, results: Sequence[ComponentResult], untaken: frozenset[Place] = frozenset()
) -> dict[Place, PaintState]:
    """Return what cases made of each transition; arguments as of `machine_pieces`. Empty if all cases are of timing."""
    return {} if all(one.bound for one in results) else _states(model, taken_by(order_of, results), untaken)


def _states(model: Cefsm, taken: Mapping[Place, TransitionCases], untaken: frozenset[Place]) -> dict[Place, PaintState]:
    return {
        (place := (component.name, one.id)): _state(taken.get(place, TransitionCases()), place in untaken)
        for component in model.components
        for machine in component.machines
        for one in machine.transitions
    }


def machine_pieces(
    model: Cefsm,
    order_of: OrderOf,
    results: Sequence[ComponentResult],
    where: str,
    *,
    untaken: frozenset[Place] = frozenset(),
    prefix: str = "",
) -> list[Piece]:
    """Return components and channels with the messages between them, every machine, painted, and a table of
    transitions with the cases that took them.

    Args:
        model: what is drawn.
        order_of: of its abstract cases.
        results: of cases.
        where: they ran, in words.
        untaken: transitions that only infeasible cases would take.
        prefix: what the ids of cases begin with on the page.
    """  # fmt: skip
    if all(one.bound for one in results):
        return []
    taken = taken_by(order_of, results)
    states = _states(model, taken, untaken)
    pieces: list[Piece] = [*channel_figure(model, results, where)]
    rows: list[tuple[Cell, ...]] = []
    anchors: list[str] = []
    for component in model.components:
        for machine in component.machines:
            painted: dict[str, Paint] = {}
            for one in machine.transitions:
                at = taken.get((component.name, one.id), TransitionCases())
                state = states[component.name, one.id]
                anchor = f"taken_{plain_anchor(f'{where} {component.name} {one.id}')}"
                painted[one.id] = Paint(state, f"{state}, {at.passed} passed, {at.failed} failed", anchor)
                first = at.failing[0] if at.failing else ""
                others = [*at.failing[1:], *at.passing][: _NAMED - 1]
                more = at.passed + at.failed - len(others) - bool(first)
                rows.append((
                    component.name, one.id, f"{one.source} \N{RIGHTWARDS ARROW} {one.target}",
                    Marked(state, _TONES[state]), at.passed, at.failed,
                    Marked(first, "bad", link=f"case_{plain_anchor(f'{prefix}{first}')}") if first else "",
                    ", ".join([*others, f"{more:,} more"] if more else others),
                ))  # fmt: skip
                anchors.append(anchor)
            title = component.name if len(component.machines) == 1 else f"{component.name}: {machine.name}"
            said = ", ".join(f"{id} {paint.words}" for id, paint in painted.items())
            pieces.append(Figure(title, _drawing(machine, title, painted), f"State machine of {title}: {said}"))
    columns = (
        Column("component"), Column("transition", code=True), Column("from \N{RIGHTWARDS ARROW} to"), Column("state"),
        Column("passed", ",d", group="cases"), Column("failed", ",d", group="cases"),
        Column("first failing case", code=True), Column("other cases", code=True),
    )  # fmt: skip
    note = (
        "*Covered*: a case that passed took it. *Failing*: a case was to take it and did not, or no case that was to "
        "take it passed. *Infeasible*: no values let any case take it. *Uncovered*: no case was to take it."
    )
    counts = Counter(str(row[3].value) for row in rows if isinstance(row[3], Marked))
    title = f"Transitions, {where}: {', '.join(f'{counts[state]} {state}' for state in _TONES if counts[state])}"
    return [*pieces, Table(title, columns, tuple(rows), note, anchors=tuple(anchors))]


def _drawing(machine: Machine, title: str, painted: Mapping[str, Paint]) -> Callable[[], str]:
    return lambda: to_svg(machine, title, painted)


def _state(at: TransitionCases, infeasible: bool) -> PaintState:
    if at.broke or (at.failed and not at.passed):
        return "failing"
    if at.passed:
        return "covered"
    return "infeasible" if infeasible else "uncovered"
