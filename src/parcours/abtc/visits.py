"""Rearranges the visits of a serialised case: some once more by the environment, or all of a component as one instance.

an instance per visit         one instance per case
Client#0  ask!  ok?           Client  ask!       ok?  ask!       ok?
Server    ask?      ok!       Server       ask?  ok!
Client#2  ask!           ok?  tester                       ask?  ok!
          |              |
          the answer to #0 goes to #2            the answer goes to the visit that asked
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise

from parcours.abtc.sequencing import Emission, Event, Reception
from parcours.errors import BadSuite


@dataclass(frozen=True, slots=True)
class Visits:
    """The events of a case in the order in which they are enforced, and what comes beside them.

    Attributes:
        events: with all that they receive.
        early: event -> the events whose messages come just before it, while their instance is busy with it.
        again: event that receives an answer -> an event before it that received another one on the same channel, which
            comes once more just before it.
    """

    events: tuple[Event, ...]
    early: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    again: Mapping[int, int] = field(default_factory=dict)

    @property
    def enforced(self) -> tuple[Event, ...]:
        """The events as they are enforced: those whose messages came early receive nothing in their turn."""
        early = {one for those in self.early.values() for one in those}
        return tuple(replace(event, receives=None) if event.position in early else event for event in self.events)


def ask_alone(events: Sequence[Event]) -> tuple[Event, ...]:
    """Return a case's events, then those of paths that hear from other components only, asked by the environment.

    What such a path receives is decided by its peers; asked once more, by the environment, it receives what test data
    says. These visits are the last: they have no part in the interaction.
    """
    heard: dict[tuple[str, str], dict[str, bool]] = {}  # path -> channel -> whether the environment sends on it
    lines: dict[int, list[Event]] = {}
    for event in events:
        lines.setdefault(event.reference, []).append(event)
        if event.receives is not None:
            channels = heard.setdefault((event.component, event.path), {})
            channel = event.receives.channel
            channels[channel] = channels.get(channel, False) or event.receives.event is None
    made = list(events)
    ends = tuple(line[-1].position for line in lines.values())
    for component, path in [path for path, channels in heard.items() if not all(channels.values())]:
        reference, after = max(event.reference for event in made) + 1, ends
        line = next(one for one in lines.values() if (one[0].component, one[0].path) == (component, path))
        for event in line:
            position, turn = len(made), made[-1].turn + 1
            receives = event.receives and Reception(event.receives.channel)
            sends = tuple(Emission(sent.channel) for sent in event.sends)
            made.append(replace(event, position=position, turn=turn, reference=reference, receives=receives,
                                sends=sends, after=after, before=None))  # fmt: skip
            after = (position,)
    return tuple(made)


def as_one_instance(events: Sequence[Event], takes_any_time: Callable[[str], bool] = lambda name: True) -> Visits:
    """Return a case in which all visits of a component are one instance, whose reference is that of the first.

    It makes one visit after the other. An answer goes to the visit that asked; the one that was to receive it is
    answered by the environment. A visit that begins while the one before goes on finds the instance busy: where the
    component takes messages at any time, that of the environment arrives early.

    Raises BadSuite: a visit waits for one that comes after it.
    """
    lines: dict[int, list[Event]] = {}
    for event in events:
        lines.setdefault(event.reference, []).append(event)
    of: dict[str, list[int]] = {}
    for reference in sorted(lines):
        of.setdefault(lines[reference][0].component, []).append(reference)
    first = {reference: references[0] for references in of.values() for reference in references}
    receives, again = _rerouted(events, lines)
    order = _ordered(events, [[e for r in references for e in lines[r]] for references in of.values()], receives)
    place = {old: new for new, old in enumerate(order)}
    made: list[Event] = []
    for old in order:
        event = events[old]
        got = receives[old]
        source = None if got is None or got.event is None else place[got.event]
        sends = tuple(Emission(one.channel, one.to, None if one.reference is None else first[one.reference])
                      for one in event.sends)  # fmt: skip
        made.append(replace(event, position=place[old], turn=place[old], reference=first[event.reference], sends=sends,
                            receives=got and Reception(got.channel, source), after=(place[old] - 1,) if made else (),
                            before=None))  # fmt: skip
    early: dict[int, tuple[int, ...]] = {}
    for component, references in of.items():
        for before, reference in pairwise(references):
            opening = lines[reference][0]
            busy = next((one for one in lines[before][1:] if one.position > opening.position), None)
            got = receives[opening.position]
            if busy is not None and got is not None and got.event is None and takes_any_time(component):
                early[place[busy.position]] = (*early.get(place[busy.position], ()), place[opening.position])
    return Visits(tuple(made), early, {place[one]: place[other] for one, other in again.items()})


def _rerouted(
    events: Sequence[Event], lines: Mapping[int, Sequence[Event]]
) -> tuple[dict[int, Reception | None], dict[int, int]]:
    """Return what each event receives, answers by those who asked; and in the place of which event each of these is."""
    receives = {event.position: event.receives for event in events}
    again: dict[int, int] = {}
    for event in events:
        if event.receives is None or event.receives.event is None:
            continue
        answer, channel = events[event.receives.event], event.receives.channel
        requests = [one.receives.event for one in lines[answer.reference]
                    if one.position <= answer.position and one.receives and one.receives.event is not None]  # fmt: skip
        for request in reversed(requests):
            asker = lines[events[request].reference]
            waiting = next(
                (e for e in asker if e.position > request and receives[e.position] == Reception(channel)), None
            )
            if asker[0].component == event.component and asker[0].reference != event.reference and waiting is not None:
                receives[waiting.position], receives[event.position] = event.receives, Reception(channel)
                again[event.position] = waiting.position
                break
    return receives, again


def _ordered(
    events: Sequence[Event], chains: Sequence[Sequence[Event]], receives: Mapping[int, Reception | None]
) -> list[int]:
    """Return the positions in an order that keeps each chain and lets sends come before receives, else as they were."""
    needs: dict[int, set[int]] = {event.position: set() for event in events}
    for chain in chains:
        for one, other in pairwise(chain):
            needs[other.position].add(one.position)
    for position, got in receives.items():
        if got is not None and got.event is not None:
            needs[position].add(got.event)
    sorter, order, ready = TopologicalSorter(needs), list[int](), list[int]()
    try:
        sorter.prepare()
    except CycleError as error:
        rule = f"visits of one instance must follow each other, but events {error.args[1]} wait for each other"
        raise BadSuite(
            "serialised case", rule, "run it with one instance per visit", slug="serialisation-stuck"
        ) from None
    while sorter.is_active():
        ready = sorted([*ready, *sorter.get_ready()])
        sorter.done(ready[0])
        order.append(ready.pop(0))
    return order
