"""The serialised execution sequence of an abstract test case: which transition is taken when, after what.

References run in lock step, one transition each a turn; each is an instance of its own of its component. A
receive waits for its send by the visit before it; what no earlier path sends, the environment supplies.

    turn             0      1      2      3
    visit 0  tp12    ask!   work   done              ask!  sends to the next visit
    visit 1  tp21    ·      ask?   send!             ask?  comes after its send: `after` holds its position
    visit 2  tp12                  ask!   work       starts when tp21 has come to its point: `after` ask?,
                                                     and while it is there: `before` send!
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from parcours.abtc.rendezvous import sends_on
from parcours.abtc.serialising import AbstractCase
from parcours.errors import BadSuite
from parcours.model.structure import Transition


@dataclass(frozen=True, slots=True)
class Reception:
    """What a transition receives: from the send at position `event`; from the environment if that is None."""

    channel: str
    event: int | None = None


@dataclass(frozen=True, slots=True)
class Emission:
    """What a transition sends: to a reference that receives it, a stand-in that does not, or the tester."""

    channel: str
    to: Literal["reference", "stand-in", "environment"] = "environment"
    reference: int | None = None


@dataclass(frozen=True, slots=True)
class Event:
    """One transition of a serialised execution sequence.

    `after` holds the positions of the events it had to wait for: the one before it on its own path, the one
    that brings the path before it to the starting point, the send it receives. `before`, given for the first
    event of a reference, is the event by which the path before it leaves that point. Any order that keeps
    both is a run of the model. Events of one `turn` are simultaneous in the lock step.
    """

    position: int
    turn: int
    reference: int
    visit: int
    component: str
    machine: str
    path: str
    transition: str
    receives: Reception | None = None
    sends: tuple[Emission, ...] = ()
    after: tuple[int, ...] = ()
    before: int | None = None

    @property
    def role(self) -> str:
        """What the event does for the interaction, in words."""
        words = []
        if self.receives:
            source = "the environment" if self.receives.event is None else f"event {self.receives.event}"
            words.append(f"receive {self.receives.channel} from {source}")
        for sent in self.sends:
            target = "the environment" if sent.reference is None else f"{sent.to} {sent.reference}"
            words.append(f"send {sent.channel} to {target}")
        return ", ".join(words) or "internal"

    def __str__(self) -> str:
        return f"{self.position} {self.component} {self.path}#{self.reference} {self.transition}: {self.role}"


def serialise(case: AbstractCase) -> tuple[Event, ...]:
    """Return the serialised execution sequence of a case.

    Raises:
        BadSuite: references wait for each other and none can go on, as in a case whose starts were edited.
    """
    return _LockStep(case).run()


class _LockStep:
    def __init__(self, case: AbstractCase) -> None:
        self.case = case
        self.references = case.combination.references
        self.events: list[Event] = []
        self.started: set[int] = set()
        # for each reference, the positions of its events
        self.taken: list[list[int]] = [[] for _ in self.references]
        # by receiving visit and channel: the positions of the sends, and how many of them were received
        self.posted: dict[tuple[int, str], list[int]] = {}
        self.collected: dict[tuple[int, str], int] = {}

    def run(self) -> tuple[Event, ...]:
        turn = 0
        while any(self._lacks(reference) for reference in range(len(self.references))):
            before = len(self.events)
            newcomers = self._start()
            for reference in [*newcomers, *sorted(self.started - set(newcomers))]:
                if self._lacks(reference):
                    self._step(turn, reference)
            if len(self.events) == before:
                raise self._stuck()
            turn += 1
        return tuple(self._with_window(event) for event in self.events)

    def _lacks(self, reference: int) -> bool:
        return len(self.taken[reference]) < len(self.references[reference][1].transitions)

    def _start(self) -> list[int]:
        # Newcomers move first, while the reference before them still stands at the starting point.
        newcomers = []
        for reference, start in enumerate(self.case.starts):
            if reference not in self.started and (
                start.after is None or (start.after in self.started and len(self.taken[start.after]) >= start.done)
            ):
                self.started.add(reference)
                newcomers.append(reference)
        return newcomers

    def _step(self, turn: int, reference: int) -> None:
        visit, path = self.references[reference]
        transition = path.transitions[len(self.taken[reference])]
        send = self._supplier(visit, transition)
        if send == "wait":
            return
        position = len(self.events)
        receives = Reception(transition.event.channel, send) if transition.event else None
        sends = tuple(self._emission(visit, path.name, sent.channel) for sent in transition.sends)
        place = (position, turn, reference, visit, path.component, path.machine, path.name, transition.id)
        self.events.append(Event(*place, receives, sends, self._causes(reference, send)))
        self.taken[reference].append(position)
        if transition.event and send is not None:
            self._collect(visit, transition.event.channel, send, reference)
        for sent in transition.sends:
            self.posted.setdefault((visit + 1, sent.channel), []).append(position)

    def _supplier(self, visit: int, transition: Transition) -> int | Literal["wait"] | None:
        # The position of the send to receive, "wait" if it is yet to come, None for the environment.
        if transition.event is None or visit == 0 or not self.case.combination.meetings:
            return None
        channel = transition.event.channel
        ours = self.collected.get((visit, channel), 0)
        senders = self.case.combination.visits[visit - 1]
        if ours >= sum(sends_on(t, channel) for path in senders for t in path.transitions):
            return None
        posted = self.posted.get((visit, channel), [])
        return posted[ours] if ours < len(posted) else "wait"

    def _collect(self, visit: int, channel: str, send: int, reference: int) -> None:
        self.collected[visit, channel] = self.collected.get((visit, channel), 0) + 1
        sender = self.events[send]
        delivered = Emission(channel, "reference", reference)
        sends = tuple(delivered if sent.channel == channel else sent for sent in sender.sends)
        self.events[send] = replace(sender, sends=sends)

    def _emission(self, visit: int, path: str, channel: str) -> Emission:
        # As far as known when it is sent: to a stand-in, or to the tester until a reference receives it.
        if visit < len(self.case.combination.meetings):
            for meeting in self.case.combination.meetings[visit]:
                if meeting.stand_in and meeting.channel == channel and meeting.sender.name == path:
                    ahead = self.references.index((visit + 1, meeting.receiver))
                    return Emission(channel, "stand-in", ahead)
        return Emission(channel)

    def _causes(self, reference: int, send: int | None) -> tuple[int, ...]:
        causes = set() if send is None else {send}
        if self.taken[reference]:
            causes.add(self.taken[reference][-1])
        else:
            start = self.case.starts[reference]
            while start.after is not None and start.done == 0:
                start = self.case.starts[start.after]
            if start.after is not None:
                causes.add(self.taken[start.after][start.done - 1])
        return tuple(sorted(causes))

    def _with_window(self, event: Event) -> Event:
        # A first event gets the one that it must precede, unless it had to wait for a message itself.
        start = self.case.starts[event.reference]
        if event.position != self.taken[event.reference][0] or start.after is None or start.until is None:
            return event
        leaving = self.taken[start.after][start.until]
        return replace(event, before=leaving) if event.position < leaving else event

    def _stuck(self) -> BadSuite:
        waiting = ", ".join(f"{path.name}#{r}" for r, (_, path) in enumerate(self.references) if self._lacks(r))
        rule = f"must run to its end, but {waiting} cannot go on after {len(self.events)} steps"
        remedy = "generate the case again instead of editing its starts"
        return BadSuite(f"abstract case {self.case.id}", rule, remedy, slug="serialisation-stuck")
