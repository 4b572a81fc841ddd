"""A serialised abstract case -> nodes of others kept in its order: messages held, made up, let go at their turn.

A node cannot be told when to take a transition; it can be kept from taking it. What it waits for is held in a gate
until its turn. Where that does not keep it, as a server between a request and its response, its process is stopped at
that point. What comes too early all the same, or does not come, leaves the case without a verdict.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from parcours.abtc import Event
from parcours.run.binding.passing import CONTINUED, ENDS, STOPPED, Call, Message
from parcours.run.binding.slots import Slot
from parcours.run.enforcement import instance_name
from parcours.run.hosts.ros1.foreign_session import Session
from parcours_navigation.foreign.background import Background
from parcours_navigation.foreign.judging import AbstractJudge
from parcours_navigation.foreign.system import answer_call
from parcours_navigation.foreign.tester_messages import Maker

PATIENCE = 4_000_000_000
"""So long an event may take once it is its turn [ns]."""

UNSEEN = "not visible: assumed"
_SETTLE = 200_000_000
"""So long the background runs before the case begins to move [ns]."""


@dataclass(eq=False, slots=True)
class _Turn:
    """An event under way: since when, and what it has yet to send."""

    event: Event
    since: int = -1
    missing: list[str] = field(default_factory=list)
    last: int = -1
    is_given: bool = False


class AbstractDrive:
    """Enforces the order of a case on a session.

    Args:
        session: started, with a slot for each reference whose component a node runs.
        judge: of the case; the session's listener is its `observe`.
        maker: makes the tester's messages.
        events: `serialise(abstract_case)`.
        early: requests that came before the case began.
        patience: so long an event may take once it is its turn [ns].
    """

    def __init__(self, session: Session, judge: AbstractJudge, maker: Maker, events: Sequence[Event],
                 early: Sequence[Message] = (), patience: int = PATIENCE) -> None:  # fmt: skip
        self._session, self._relay, self._judge, self._maker = session, session.relay, judge, maker
        self._events, self._patience, self._early = events, patience, early
        self._slots: dict[int, Slot] = {
            slot.reference: slot for slot in session.slot_plan.slots if slot.reference is not None
        }
        self._of_slot = {slot.name: reference for reference, slot in self._slots.items()}
        self._to_do: dict[int, deque[_Turn]] = {}
        for event in events:
            turn = _Turn(event, missing=[send.channel for send in event.sends if self._is_bound(send.channel)])
            self._to_do.setdefault(event.reference, deque()).append(turn)
        self._done: set[int] = set()
        self._barriers: dict[int, list[int]] = {}
        for event in events:
            if event.before is not None:
                self._barriers.setdefault(event.before, []).append(event.position)
        self._gates: dict[tuple[int, str], deque[Message]] = {}
        self._frozen: set[int] = set()
        self._failed = ""
        model = session.host.binding.model
        machines = {(part.name, one.name): one for part in model.components for one in part.machines}
        self._may_send = {
            key: {send.channel for transition in one.transitions for send in transition.sends}
            for key, one in machines.items()
        }
        self._background = Background(session, maker, events)
        self._relay.arrived, self._relay.unserved = self._arrived, self._unserved

    def _is_bound(self, channel: str) -> bool:
        return any(one.name == channel and one.role == "model" for one in self._session.host.binding.channels)

    def run(self) -> None:
        """Run the case to its end, or to the first event that cannot be had.

        Raises:
            HostFailure: a message of the tester's cannot be made.
        """
        session = self._session
        begin = session.case_began + _SETTLE
        for message in self._early:
            self._arrived(message)
        while not self._is_over():
            now = session.now()
            self._background.tell(now)
            if now >= begin:
                self._grant(now)
            session.poll(session.now() + 5_000_000)
            self._judge.watch.quiet(session.horizon)
            self._expire(session.now())
        self._thaw(all_of_them=True)
        if self._failed:
            self._relay.tell("deviation", "", text=self._failed)
        self._relay.note(ENDS)

    def _is_over(self) -> bool:
        watch = self._judge.watch
        wrong = self._failed or watch.deviations or self._session.deaths or watch.unreadable
        return bool(wrong) or len(self._done) == len(self._events)

    def _made(self, channel: str) -> bytes:
        now = self._session.now() - self._session.case_began
        return self._maker.of_the_environment(channel, now, time.time())

    # Whose turn it is.

    def _is_due(self, event: Event, done: Collection[int] | None = None) -> bool:
        done = self._done if done is None else done
        return all(one in done for one in (*event.after, *self._barriers.get(event.position, ())))

    def _grant(self, now: int) -> None:
        """Let every reference begin what is its turn; again, while something was over at once."""
        moved = True
        while moved and not self._failed:
            moved = False
            self._thaw()
            for reference, to_do in self._to_do.items():
                if to_do and to_do[0].since < 0 and self._is_due(to_do[0].event):
                    to_do[0].since = now
                    moved |= self._begin(reference, to_do[0])
                elif to_do and to_do[0].since >= 0 and not to_do[0].missing and to_do[0].is_given:
                    moved |= self._finish(reference, to_do[0])

    def _begin(self, reference: int, turn: _Turn) -> bool:
        event = turn.event
        if reference not in self._slots:
            self._play(turn)
        elif event.receives is not None and self._is_bound(event.receives.channel):
            if not turn.missing:
                self._freeze(reference, event.position)
            self._give(reference, turn)
        turn.is_given = True
        return bool(not turn.missing and not self._failed and self._finish(reference, turn))

    def _play(self, turn: _Turn) -> None:
        """Do in the place of a component that no node runs what the event says."""
        event = turn.event
        for channel in list(turn.missing):
            self._gated(event, self._relay.made(channel, self._made(channel)))
        turn.missing.clear()

    def _give(self, reference: int, turn: _Turn) -> None:
        """Open the gate of the message that the event receives, or make it up."""
        event, slot = turn.event, self._slots[reference]
        assert event.receives is not None
        channel, source = event.receives.channel, event.receives.event
        if source is None:
            message = self._relay.made(channel, self._made(channel))
        else:
            gate = self._gates.get((source, channel))
            if not gate:
                self._failed = f"{event.transition} of {slot.name} awaits {channel}, which event {source} did not send"
                return
            message = gate.popleft()
            self._relay.record("release", message.sender, message)
        part = self._session.host.binding.channel(channel).part
        if part == "response":
            call = self._call_of(slot, channel)
            if call is None:
                self._failed = f"{event.transition} of {slot.name} awaits an answer on {channel}, but has asked nothing"
                return
            self._relay.answer(call, message)
        else:
            copy = Message(message.number, channel, message.slot, message.sender, message.data, message.time)
            self._relay.release(copy, slot.name)
        turn.last = self._session.now()

    def _call_of(self, slot: Slot, channel: str) -> Call | None:
        service = self._session.host.binding.channel(channel).address
        spokes = [one.address for one in self._session.slot_plan.spokes
                  if one.slot == slot.name and one.side == "out" and channel in one.channels]  # fmt: skip
        calls = [call for call in self._relay.calls if call.client == slot.name and call.service in (service, *spokes)]
        return calls[0] if calls else None

    def _finish(self, reference: int, turn: _Turn) -> bool:
        """The event is over: write down that its transition was taken."""
        to_do = self._to_do[reference]
        to_do.popleft()
        event = turn.event
        is_seen = turn.last >= 0 or reference not in self._slots
        stamp = turn.last if turn.last >= 0 else self._session.now()
        self._done.add(event.position)
        self._relay.tell("take", instance_name(event), event.transition, "" if is_seen else UNSEEN, stamp)
        if reference in self._slots:
            self._freeze(reference)
        return True

    # A process is kept at a point where nothing else keeps it.

    def _freeze(self, reference: int, after: int | None = None) -> None:
        """Stop the process if what it shall do next, once the event `after` is over, is not its turn yet."""
        to_do, slot = list(self._to_do[reference]), self._slots[reference]
        follows = to_do[1:] if after is not None else to_do
        if not follows or not slot.node.is_ours or reference in self._frozen:
            return
        done = self._done if after is None else self._done | {after}
        if self._is_due(follows[0].event, done):
            return
        self._frozen.add(reference)
        self._session.hold(slot)
        for component in slot.node.components:
            self._relay.note(STOPPED, slot.component(component))

    def _thaw(self, *, all_of_them: bool = False) -> None:
        for reference in list(self._frozen):
            to_do = self._to_do[reference]
            if all_of_them or not to_do or self._is_due(to_do[0].event):
                self._frozen.discard(reference)
                slot = self._slots[reference]
                for component in slot.node.components:
                    self._relay.note(CONTINUED, slot.component(component))
                self._session.act(slot, "continue")

    # What nodes say.

    def _arrived(self, message: Message) -> None:
        reference = self._of_slot.get(message.slot)
        to_do = self._to_do.get(reference, deque()) if reference is not None else deque()
        turn = to_do[0] if to_do else None
        if turn is None or message.channel not in turn.missing or not self._is_possible(turn):
            self._aside(message, turn)
            return
        assert reference is not None
        turn.missing.remove(message.channel)
        turn.last = message.time
        self._gated(turn.event, message)
        if not turn.missing:
            turn.is_given = True
            self._finish(reference, turn)

    def _is_possible(self, turn: _Turn) -> bool:
        """Whether the event can have begun: nothing that it receives is still kept from it."""
        return turn.is_given or turn.event.receives is None

    def _gated(self, event: Event, message: Message) -> None:
        sent = next(send for send in event.sends if send.channel == message.channel)
        self._relay.settle(message)
        if sent.to == "reference":
            self._gates.setdefault((event.position, message.channel), deque()).append(message)
            self._relay.record("hold", message.sender, message)
        else:
            self._relay.collect(message)

    def _strays(self, message: Message, event: Event) -> bool:
        return message.channel in self._may_send[event.component, event.machine]

    def _unserved(self, message: Message) -> None:
        if message.call is not None:
            answer_call(
                self._relay, self._maker, self._session.host.binding.channel(message.channel).address, message.call
            )

    def _aside(self, message: Message, turn: _Turn | None) -> None:
        """Something that is no part of the case: the tester takes it, and answers what is asked."""
        self._relay.settle(message)
        self._relay.collect(message)
        binding = self._session.host.binding
        bound = binding.channel(message.channel)
        if bound.role == "between":
            self._relay.release(message)
        elif turn is not None and self._session.case_began >= 0 and self._strays(message, turn.event):
            self._failed = self._failed or (
                f"{message.sender} sent {message.channel} where {turn.event.transition} was due"
            )
        if message.call is not None and message.call.reply is not None:
            answer_call(self._relay, self._maker, bound.address, message.call)

    def _expire(self, now: int) -> None:
        for reference, to_do in self._to_do.items():
            if to_do and to_do[0].since >= 0 and now - to_do[0].since > self._patience and not self._failed:
                event = to_do[0].event
                wanted = ", ".join(to_do[0].missing)
                name = self._slots[reference].name if reference in self._slots else event.component
                self._failed = (
                    f"{name} did not take {event.transition} (send {wanted}) within {self._patience * 1e-9:g} s"
                )
