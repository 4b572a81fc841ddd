"""Runs events with chosen inputs through the step relation: the values that each one read, or why it cannot run.

Every step is taken by `parcours.model.Steps`, with the tester at both ends of every channel; he passes on each
message that an earlier event of the sequence sent, as gated execution does. So nothing is called executable that
the step relation does not execute.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass

from parcours.errors import BadModel, BadRequest
from parcours.model import StepRelation
from parcours.model.configuration import Configuration, Inputs, Layout, Move
from parcours.model.expression import evaluate
from parcours.model.solutions import with_terms
from parcours.model.structure import Cefsm
from parcours.paths.timing.events import TimedEvent, taken_messages


@dataclass(frozen=True, slots=True)
class Replayed:
    """A run of the model.

    Attributes:
        moves: what was done, with inputs and the contents of messages as ('Component.term', value).
        known: the values that each event could read before its actions, by name.
        why_not: why the run ended early; empty if it did not.
    """

    moves: tuple[Move, ...]
    known: tuple[Mapping[str, object], ...]
    why_not: str = ""


class StepReplay:
    """The step relation of one model, for sequences of events."""

    def __init__(self, cefsm: Cefsm) -> None:
        self._steps = StepRelation(cefsm, frozenset(channel.name for channel in cefsm.channels))
        self._sites = Layout(cefsm).sites

    def run(self, events: Sequence[TimedEvent], inputs: Sequence[Inputs]) -> Replayed:
        """Return the run of some events from the initial configuration."""
        stands: dict[int, Configuration] = {}
        taken = taken_messages(events)
        posted: dict[tuple[int, str], tuple[tuple[str, object], ...]] = {}
        moves: list[Move] = []
        known: list[Mapping[str, object]] = []
        for event, chosen in zip(events, inputs, strict=True):
            here = stands.get(event.instance) or self._steps.layout.initial()
            site = self._steps.layout.sites[event.transition.id]
            received = posted.get((event.send, event.transition.event.channel), ()) if event.transition.event else ()
            name = event.transition.event.name if event.transition.event is not None else ""
            given = dict(chosen) | {f"{event.component}.{name}.{field}": value for field, value in received if name}
            move = Move(event.transition.id, "", tuple(sorted(given.items())))
            prefix = f"{event.component}."
            terms = {term[len(prefix) :]: value for term, value in given.items() if term.startswith(prefix)}
            known.append(with_terms(self._steps.choices.known(here, site, ()), terms))
            moves.append(move)
            if (why_not := _unread(event, known[-1])) is not None:
                return Replayed(tuple(moves), tuple(known), why_not)
            try:
                stands[event.instance] = after = self._steps.step(here, move)
                read = with_terms(self._steps.choices.known(after, site, ()), terms)
                posted |= self._posted(event, read, taken)
            except (BadModel, BadRequest) as error:
                return Replayed(tuple(moves), tuple(known), f"{error.where}: {error.rule}")
        return Replayed(tuple(moves), tuple(known))

    def _posted(
        self, event: TimedEvent, read: Mapping[str, object], taken: Set[tuple[int, str]]
    ) -> dict[tuple[int, str], tuple[tuple[str, object], ...]]:
        # What the messages say that leave with an event and are taken; fields that are not computed stay open.
        found = {}
        for send, content in zip(event.transition.sends, self._sites[event.transition.id].contents, strict=True):
            if (event.number, send.channel) not in taken:
                continue
            said = []
            for field, expression in content.fields:
                try:
                    said.append((field, evaluate(expression, read, f"message of {event.transition.id!r}")))
                except BadModel as error:
                    if error.slug != "no-value":
                        raise
            found[event.number, send.channel] = tuple(said)
        return found


def _unread(event: TimedEvent, known: Mapping[str, object]) -> str | None:
    # The step relation lets a guard pass that reads what nobody chose: nothing is shown by that here.
    try:
        if event.transition.guard is not None:
            evaluate(event.transition.guard, known, f"guard of {event.transition.id!r}")
    except BadModel as error:
        return f"{error.where}: {error.rule}"
    return None
