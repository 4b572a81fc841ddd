"""Keeps foreign nodes in the order of an abstract case: holds messages, makes them up, lets them go at their turn.

Nobody can make a node take a transition; but it can be kept from taking it. What it waits for is held in a gate
until its turn. Where that does not keep it, as a server between a request and its response, its process is stopped at
that point. What comes too early all the same, or does not come, leaves the case without a verdict.

    A#0                    relay                                        B#1
     |  event 3: obstacles   |                                            |  event 5 waits for obstacles
     |---------------------->|  hold in gate (3, obstacles)               |
     |                       |  ... turns of events 4, then 5: release -->|
     |                       |<--------------------- what event 5 sends --|
     |<-- SIGSTOP, SIGCONT --|  where event 6 of A#0 waits for no message
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from parcours.abtc import Event
from parcours.run.binding.in_transit import CONTINUED, ENDS, STOPPED, RawMessage, ServiceCall
from parcours.run.binding.slots import ProcessSlot
from parcours.run.enforcement import Precedence, instance_name
from parcours.run.hosts.foreign.session import Session
from parcours_navigation.foreign.judging import AbstractJudge
from parcours_navigation.foreign.tester_messages import Maker

PATIENCE = 4_000_000_000
"""How long an event may take once it is its turn [ns]."""

UNSEEN = "not visible: assumed"
_REST = 50_000_000
"""How long a node that sends nothing back and never rests may work on a message [ns of processor time].

No clock on the wall will do: on a busy machine a node may not have begun by then, and would get the next message, too.
"""
_GLANCE = 200_000
"""Interval between two looks at whether it rests [ns]."""
_SETTLE = 200_000_000
"""How long the background runs, and nodes get on that were waiting for an answer, before the case moves [ns]."""
_NEVER = 1 << 62


@dataclass(eq=False, slots=True)
class _Turn:
    """An event under way: since when, and what it has yet to send."""

    event: Event
    since: int = -1
    missing: list[str] = field(default_factory=list)
    last: int = -1
    is_given: bool = False
    effort: int = -1
    """The processor time of the process that took its message without an answer, when it got it [ns]; else negative."""


@dataclass(slots=True)
class _Sensed:
    channel: str
    slot: str | None
    period: int
    due: int = 0


class _Background:
    """Says what `sense` of the binding names, to every process whose part of the case does not receive just that."""

    def __init__(self, session: Session, maker: Maker, events: Sequence[Event]) -> None:
        self._session, self._maker = session, maker
        system = session.host.binding.system
        references = {slot.name: slot.reference for slot in session.slot_plan.slots}
        self._sensed: list[_Sensed] = []
        for channel, period in system.sense if system else ():
            given = {one.reference for one in events if one.receives is not None and one.receives.channel == channel}
            for spoke in session.slot_plan.speaking(channel):
                if references.get(spoke.slot, -1) not in given:
                    self._sensed.append(_Sensed(channel, spoke.slot or None, round(period * 1e9)))

    @property
    def is_needed(self) -> bool:
        """Whether there is anything to say."""
        return bool(self._sensed)

    def say(self, now: int) -> None:
        """Say what is due [ns since the run began]."""
        for one in self._sensed:
            if now >= one.due:
                one.due = now + one.period
                data = self._maker.of_the_environment(one.channel, now - self._session.case_began)
                self._session.relay.inject(one.channel, data, one.slot)


class AbstractDrive:
    """Enforces the order of a case on a session.

    Args:
        session: started, with a slot for each reference whose component a node runs.
        judge: of the case; the session's listener is its `observe`.
        maker: makes the tester's messages.
        events: `serialise(abstract_case)`.
        early: requests that came before the case began.
    """

    def __init__(self, session: Session, judge: AbstractJudge, maker: Maker, events: Sequence[Event],
                 early: Sequence[RawMessage] = ()) -> None:  # fmt: skip
        self._session, self._relay, self._judge, self._maker = session, session.relay, judge, maker
        self._events, self._early = events, early
        self._binding = session.host.binding
        self._slots: dict[int, ProcessSlot] = {
            slot.reference: slot for slot in session.slot_plan.slots if slot.reference is not None
        }
        self._beside = {slot.name for slot in session.slot_plan.slots if slot.reference is None}
        self._of_slot = {slot.name: reference for reference, slot in self._slots.items()}
        self._bound = {one.name for one in self._binding.channels if one.role == "model"}
        self._to_do: dict[int, deque[_Turn]] = {}
        for event in events:
            turn = _Turn(event, missing=[send.channel for send in event.sends if send.channel in self._bound])
            self._to_do.setdefault(event.reference, deque()).append(turn)
        self._done: set[int] = set()
        self._begins = _NEVER
        """When the case moves [ns since the run began]."""
        self._precedence = Precedence(events)
        self._gates: dict[tuple[int, str], deque[RawMessage]] = {}
        self._frozen: set[int] = set()
        self._answering: dict[str, bool] = {}
        self._failed = self._unheld()
        self._background = _Background(session, maker, events)
        self._relay.arrived = self._arrived
        self._relay.unserved = lambda message: maker.answer(self._relay, message)

    def run(self) -> None:
        """Run the case to its end, or to the first event that cannot be had.

        Raises:
            HostFailure: a message of the tester's cannot be made.
        """
        session = self._session
        is_quiet = not self._background.is_needed and not self._early and not self._relay.calls
        self._begins = session.case_began + (0 if is_quiet else _SETTLE)
        for message in self._early:
            self._arrived(message)
        while not self._is_over():
            now = session.now()
            self._background.say(now)
            self._grant(now)
            session.poll(session.now() + (_GLANCE if session.is_clock_held else 5_000_000))
            self._judge.watch.quiet(session.horizon)
            self._expire(session.now())
        self._begins = _NEVER
        self._thaw(all_of_them=True)
        if self._failed:
            self._relay.tell("deviation", "", text=self._failed)
        self._relay.note(ENDS)

    def _unheld(self) -> str:
        """Return why the case cannot be had, if nothing keeps a receiver from what it is sent; else empty."""
        sent = (send.channel for event in self._events for send in event.sends if send.channel in self._bound)
        bare = next((name for name in sent if self._binding.channel(name).observe), None)
        why = "is only observed, so its receiver cannot be kept from it: bind it without 'observe: true'"
        return "" if bare is None else f"{bare} {why}"

    def _is_over(self) -> bool:
        watch = self._judge.watch
        wrong = self._failed or watch.deviations or self._session.deaths or watch.unreadable
        return bool(wrong) or len(self._done) == len(self._events)

    def _made(self, channel: str, call: ServiceCall | None = None) -> RawMessage:
        data = self._maker.of_the_environment(channel, self._session.now() - self._session.case_began, call)
        return self._relay.made(channel, data)

    # Whose turn it is.

    def _grant(self, now: int) -> None:
        """Let every reference begin what is its turn; again, while something was over at once."""
        moved = now >= self._begins
        while moved and not self._failed:
            moved = False
            self._thaw()
            for reference, to_do in self._to_do.items():
                if to_do and to_do[0].since < 0 and self._precedence.allows(to_do[0].event, self._done):
                    to_do[0].since = now
                    moved |= self._begin(reference, to_do[0])
                elif to_do and to_do[0].since >= 0 and self._is_result(to_do[0]) and not to_do[0].is_given:
                    moved |= self._begin(reference, to_do[0])
                elif to_do and to_do[0].since >= 0 and self._is_over_for(reference, to_do[0]):
                    moved |= self._finish(reference, to_do[0])
        self._session.is_clock_held = self._is_awaited()

    def _begin(self, reference: int, turn: _Turn) -> bool:
        event = turn.event
        if reference not in self._slots:  # its component is the tester's, who does what the event says
            for channel in turn.missing:
                self._gated(event, self._made(channel))
            turn.missing.clear()
        elif event.receives is not None and event.receives.channel in self._bound:
            if self._is_result(turn) and self._call_of(self._slots[reference], event.receives.channel) is None:
                return False  # its client asks for it once it knows that its goal was accepted
            if not turn.missing and not self._freeze(reference, event.position):
                turn.effort = self._session.effort(self._slots[reference])
            self._give(reference, turn)
        turn.is_given = True
        return bool(self._is_over_for(reference, turn) and not self._failed and self._finish(reference, turn))

    def _is_result(self, turn: _Turn) -> bool:
        """Whether the event receives the result of an action in a node."""
        receives = turn.event.receives
        if receives is None or receives.channel not in self._bound or turn.event.reference not in self._slots:
            return False
        return self._binding.channel(receives.channel).action == "result"

    def _is_over_for(self, reference: int, turn: _Turn) -> bool:
        """Whether the node has done all that the event says; what it takes silently it has taken once it rests."""
        if turn.missing or not turn.is_given:
            return False
        if turn.effort < 0:
            return True
        slot = self._slots[reference]
        return self._session.rests(slot, turn.effort) or self._session.effort(slot) - turn.effort > _REST

    def _is_awaited(self) -> bool:
        return any(to_do and to_do[0].is_given and to_do[0].effort >= 0 for to_do in self._to_do.values())

    def _give(self, reference: int, turn: _Turn) -> None:
        """Open the gate of the message that the event receives, or make it up."""
        event, slot = turn.event, self._slots[reference]
        assert event.receives is not None
        channel, source = event.receives.channel, event.receives.event
        call = self._call_of(slot, channel) if self._binding.channel(channel).part == "response" else None
        if source is None:
            message = self._made(channel, call)
        else:
            gate = self._gates.get((source, channel))
            if not gate:
                self._failed = f"{event.transition} of {slot.name} awaits {channel}, which event {source} did not send"
                return
            message = gate.popleft()
            self._relay.record("release", message.sender, message)
        if self._binding.channel(channel).part == "response":
            if call is None:
                self._failed = f"{event.transition} of {slot.name} awaits an answer on {channel}, but has asked nothing"
                return
            self._relay.answer(call, message)
        else:
            given = RawMessage(
                message.number, message.channel, message.slot, message.sender, message.data, message.time
            )
            self._relay.release(given, slot.name)
        turn.last = self._session.now()

    def _call_of(self, slot: ProcessSlot, channel: str) -> ServiceCall | None:
        service = self._binding.channel(channel).address
        spokes = [one.address for one in self._session.slot_plan.spokes
                  if one.slot == slot.name and one.side == "out" and channel in one.channels]  # fmt: skip
        calls = (call for call in self._relay.calls if call.client == slot.name and call.service in (service, *spokes))
        return next(calls, None)

    def _finish(self, reference: int, turn: _Turn) -> bool:
        """The event is over: write down that its transition was taken."""
        event = self._to_do[reference].popleft().event
        is_seen = turn.last >= 0 or reference not in self._slots
        stamp = turn.last if turn.last >= 0 else self._session.now()
        self._done.add(event.position)
        self._relay.tell("take", instance_name(event), event.transition, "" if is_seen else UNSEEN, stamp)
        if reference in self._slots:
            self._freeze(reference)
        return True

    # A process is kept at a point where nothing else keeps it.

    def _freeze(self, reference: int, after: int | None = None) -> bool:
        """Stop the process if what it does next, once the event `after` is over, is not its turn yet.

        Returns whether nothing is to be awaited from it: it is stopped, or what follows shows that the event is over.
        """
        to_do, slot = list(self._to_do[reference]), self._slots[reference]
        follows = to_do[1:] if after is not None else to_do
        if not follows or not slot.node.is_ours or reference in self._frozen:
            return reference in self._frozen or not slot.node.is_ours
        receives = follows[0].event.receives
        if receives is not None and receives.channel in self._bound and (after is not None or self._only_answers(slot)):
            return False  # it waits for a message that the tester has
        done = self._done if after is None else self._done | {after}
        if not self._precedence.allows(follows[0].event, done):
            self._frozen.add(reference)
            self._session.hold(slot)
            for component in slot.node.components:
                self._relay.note(STOPPED, slot.component(component))
        return True

    def _only_answers(self, slot: ProcessSlot) -> bool:
        """Whether no component of the process may send anything that no message has led to."""
        if slot.node.name not in self._answering:
            machines = [one for name in slot.node.components for one in self._binding.model.component(name).machines]
            self._answering[slot.node.name] = all(
                step.event is not None and step.event.channel in self._bound
                for machine in machines for step in machine.transitions if step.sends
            )  # fmt: skip
        return self._answering[slot.node.name]

    def _thaw(self, *, all_of_them: bool = False) -> None:
        for reference in list(self._frozen):
            to_do = self._to_do[reference]
            if all_of_them or not to_do or self._precedence.allows(to_do[0].event, self._done):
                self._frozen.discard(reference)
                slot = self._slots[reference]
                for component in slot.node.components:
                    self._relay.note(CONTINUED, slot.component(component))
                self._session.act(slot, "continue")

    # What nodes say.

    def _arrived(self, message: RawMessage) -> None:
        reference = self._of_slot.get(message.slot, -1)
        to_do = self._to_do.get(reference)
        turn = to_do[0] if to_do else None
        if turn is None or message.channel not in turn.missing or not (turn.is_given or turn.event.receives is None):
            self._aside(message, turn)
            return
        turn.missing.remove(message.channel)
        turn.last = message.time
        self._gated(turn.event, message)
        if not turn.missing:
            turn.is_given = True
            self._finish(reference, turn)
            self._grant(self._session.now())  # at once: what it waited for goes on before anything else is done

    def _gated(self, event: Event, message: RawMessage) -> None:
        sent = next(send for send in event.sends if send.channel == message.channel)
        self._relay.settle(message)
        if self._binding.channel(message.channel).action and message.call is not None and message.call.reply:
            self._maker.answer(self._relay, message)
        if sent.to == "reference":
            self._gates.setdefault((event.position, message.channel), deque()).append(message)
            self._relay.record("hold", message.sender, message)
        else:
            self._relay.collect(message)

    def _strays(self, message: RawMessage, event: Event) -> bool:
        """Whether the machine whose turn it is sends such messages, but not now."""
        machines = self._binding.model.component(event.component).machines
        own = (one.transitions for one in machines if one.name == event.machine)
        return any(send.channel == message.channel for each in own for transition in each for send in transition.sends)

    def _aside(self, message: RawMessage, turn: _Turn | None) -> None:
        """Something that is no part of the case: the tester takes it, and answers what is asked, or lets a node."""
        if message.slot in self._beside and self._binding.channel(message.channel).part == "response":
            self._relay.release(message)
            return
        self._relay.settle(message)
        self._relay.collect(message)
        if self._binding.channel(message.channel).role == "between":
            self._relay.release(message)
        elif turn is not None and self._session.case_began >= 0 and self._strays(message, turn.event):
            self._failed = self._failed or (
                f"{message.sender} sent {message.channel} where {turn.event.transition} was due"
            )
        if message.call is not None and message.call.reply is not None:
            server = self._server_beside(message)
            if server is None:
                self._maker.answer(self._relay, message)
            else:
                self._relay.release(message, server)

    def _server_beside(self, message: RawMessage) -> str | None:
        """Return the slot of the node that answers a call that is no part of the case; None if the tester does."""
        if self._binding.channel(message.channel).answer != "node" or message.slot in self._beside:
            return None
        spokes = self._session.slot_plan.speaking(message.channel)
        return next((one.slot for one in spokes if one.slot in self._beside), None)

    def _expire(self, now: int) -> None:
        for reference, to_do in self._to_do.items():
            if to_do and to_do[0].since >= 0 and now - to_do[0].since > PATIENCE and not self._failed:
                event = to_do[0].event
                wanted = f" (send {', '.join(to_do[0].missing)})" if to_do[0].missing else ""
                name = self._slots[reference].name if reference in self._slots else event.component
                self._failed = f"{name} did not take {event.transition}{wanted} within {PATIENCE * 1e-9:g} s"
