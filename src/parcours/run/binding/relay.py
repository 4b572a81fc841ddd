"""Passes on what foreign nodes send: delivered, held, delayed or lost, with a trace of it all.

No transport is in here: a host calls `heard` and `asked` with bytes, and `Ends` lets bytes go on. Bytes first: a
message goes on as it came, and what reads its fields learns of it afterwards.

    sender -> heard: "send" -> arrived (a gate, or at once) -> release: faults -> deliver: "receive" -> receiver
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace

from parcours.model.structure import ENVIRONMENT
from parcours.run.binding.actions import ActionGoals
from parcours.run.binding.in_transit import MADE, Ends, RawMessage, ServiceCall
from parcours.run.binding.slots import ProcessSlot, SlotPlan, Spoke
from parcours.run.binding.structure import Binding
from parcours.run.faults import FaultPlan
from parcours.run.faults.corruption import corrupted_bytes
from parcours.run.faults.effects import UNTOUCHED, Agenda, Effects
from parcours.run.recording import Raw
from parcours.run.trace import Kind, TraceEvent

Hook = Callable[[RawMessage], None]


class Relay:
    """The tester's place in the middle.

    Args:
        binding: whose channels.
        slot_plan: who is there.
        ends: lets bytes go on.
        kinds: channel -> an empty message of its type, for recordings; asked for at each message.
        now: the time since the run began [ns].
        faults: of messages.
        listener: called with each event, payload included, when messages have gone on (`report`).

    Attributes:
        arrived: what is done with a message that was heard; at first `release`.
        unserved: what is done with a request that no node is there to serve; at first it fails.
        reports_at_once: whether the listener hears of each event before the message goes on; at first not.
    """

    def __init__(
        self, binding: Binding, slot_plan: SlotPlan, ends: Ends, kinds: Callable[[str], Raw],
        now: Callable[[], int], faults: FaultPlan | None = None,
        listener: Callable[[TraceEvent], None] = lambda event: None,
    ) -> None:  # fmt: skip
        self.binding, self.slot_plan, self._ends, self._kinds, self._now = binding, slot_plan, ends, kinds, now
        self._effects = Effects(faults or FaultPlan(0))
        self._listener = listener
        self.arrived: Hook = self.release
        self.unserved: Hook = lambda message: self.fail(message, "nobody serves it")
        self.reports_at_once = False
        self.events: list[TraceEvent] = []
        self._unreported: list[TraceEvent] = []
        self.case_began = -1
        """From when on faults count [ns since the run began]; -1: not yet."""
        self.calls: list[ServiceCall] = []
        """Calls of nodes that wait for their response."""
        self._numbers = itertools.count()
        self._count: Counter[str] = Counter()
        self.agenda = Agenda(now)
        """What is to be done later, by the time since the run began."""
        self._ends_of = {one.name: (one.sender, one.receiver) for one in binding.model.channels}
        self._slots: Mapping[str, ProcessSlot] = {slot.name: slot for slot in slot_plan.slots}
        self._into = {one.name: slot_plan.speaking(one.name) for one in binding.channels}
        self._timeouts = {one.name: round(one.timeout * 1e9) for one in binding.channels}
        self._raw: dict[int, Raw] = {}
        self._closed = False
        self._goals = ActionGoals()
        self._is_apart = any(slot.reference is not None for slot in slot_plan.slots)
        self._actions = {one.name: one.action for one in binding.channels}

    # What nodes say.

    def heard(self, spoke: Spoke, data: bytes) -> None:
        """A message came where the tester listens."""
        if self._closed:
            return
        for channel in spoke.channels:
            message = self._message(channel, spoke.slot, data)
            if spoke.overheard:
                self.record("receive", self._name(channel, "", 1), message)
            else:
                self.arrived(message)

    def asked(self, spoke: Spoke, data: bytes, reply: Callable[[bytes | None], None]) -> None:
        """A request came where the tester serves."""
        if self._closed:
            reply(None)
            return
        call = ServiceCall(spoke.address, spoke.slot, reply, request=data)
        if self._actions.get(spoke.channels[0]) == "goal":
            self._goals.note(spoke.slot, data)
        self.calls.append(call)
        if spoke.channels[0]:
            self.arrived(self._message(spoke.channels[0], spoke.slot, data, call))
        elif self._is_apart and self.binding.channel(spoke.channels[1]).action:
            return  # the result comes at its turn; the tester has asked the server itself
        else:  # only the responses are bound
            self._ask(RawMessage(-1, "", spoke.slot, "", data, self._now(), call), spoke.channels[1])

    # What goes on to them.

    def release(self, message: RawMessage, slot: str | None = None) -> None:
        """Let a message go on by its effect, to all its receivers, or to one slot."""
        k, began, effect = self._count[message.channel], self.case_began, UNTOUCHED
        self._count[message.channel] += 1
        if 0 <= began <= message.time:
            effect = self._effects.effect(message.channel, k, message.time - began)
        if not effect.copies:
            self.fail(message, f"fault: {effect.why}")
            return
        if effect.why:
            self.note(f"fault: {message.channel} {effect.why}", message.sender)
        data = message.data
        if effect.corrupt is not None:
            data = corrupted_bytes(data, effect.corrupt, effect.how)
        self.agenda.pass_on(message.channel, effect, lambda: self._deliver(message, slot, data))

    def _deliver(self, message: RawMessage, slot: str | None, data: bytes) -> None:
        part = self.binding.channel(message.channel).part
        if part == "request":
            self._ask(message, "", slot, data)
        elif part == "response":
            self._reply(message, data)
        else:
            self._say(message, slot, data)

    def _say(self, message: RawMessage, slot: str | None, data: bytes) -> None:
        spokes = [one for one in self._into[message.channel] if slot is None or one.slot in (slot, "")]
        if not spokes:
            self.record("receive", ENVIRONMENT, message)
        for spoke in spokes:
            data = self._fitted(message, spoke, data)
            lost = self._ends.say(spoke, data)
            who = self._name(message.channel, spoke.slot, 1)
            if lost:
                self.record("drop", who, message, "overrun: its receiver does not keep up")
            else:
                self.record("receive", who, message, data=data)

    def _ask(self, message: RawMessage, response: str, slot: str | None = None, data: bytes | None = None) -> None:
        channel = message.channel or response
        spokes = [one for one in self._into[channel] if slot is None or one.slot == slot]
        if not spokes:
            self.unserved(message)
            return
        spoke, call = spokes[0], message.call or ServiceCall(self.binding.channel(channel).address, "", None)
        message.call = call
        if message.channel:
            self.record("receive", self._name(message.channel, spoke.slot, 1), message, data=data)

        is_goal = self._actions.get(message.channel) == "goal"
        given = self._fitted(message, spoke, message.data if data is None else data)
        if is_goal:
            self._goals.note(spoke.slot, given)

        def answered(answer: bytes | None, why: str) -> None:
            if call.is_over:
                return
            if is_goal and call.reply is None and answer and ActionGoals.is_accepted(answer):
                self._ask_result(message.channel, spoke.slot, given)
            if answer is None:
                self.fail(message, f"the call failed: {why}")
            elif spoke.channels[1]:
                self.arrived(self._message(spoke.channels[1], spoke.slot, answer, call))
            else:
                self.finish(call, answer)

        def expire() -> None:
            if not call.is_over and not self._closed:
                self._ends.abandon(spoke, answered)
                self.fail(message, f"no answer within {self._timeouts[channel] * 1e-9:g} s")

        self._ends.ask(spoke, given, answered)
        self.agenda.at(self._now() + self._timeouts[channel], expire)

    def _fitted(self, message: RawMessage, spoke: Spoke, data: bytes) -> bytes:
        """Return the data as if it spoke of the goal that is known where it goes."""
        if self._actions.get(message.channel) not in ("feedback", "cancel") or not (self._is_apart or not message.slot):
            return data
        return self._goals.fitted(spoke.slot, data)

    def _ask_result(self, goal: str, slot: str, data: bytes) -> None:
        """Ask for the result of a goal of the tester's own, if it is bound."""
        address = self.binding.channel(goal).address.rpartition("/")[0]
        way_back = self.binding.ends(goal)[::-1]
        for one in self.binding.channels:
            is_its = one.address.rpartition("/")[0] == address and self.binding.ends(one.name) == way_back
            if one.action == "result" and is_its:
                call = ServiceCall(one.address, "", None)
                self._ask(RawMessage(-1, "", "", "", ActionGoals.asking(data), self._now(), call), one.name, slot)

    def _reply(self, message: RawMessage, data: bytes) -> None:
        call = message.call
        if call is None or call.is_over:
            return
        self.record("receive", self._name(message.channel, call.client, 1), message, data=data)
        self.finish(call, data)

    def answer(self, call: ServiceCall, message: RawMessage) -> None:
        """Let a message be the response to a call."""
        message.call = call
        self.release(message)

    def fail(self, message: RawMessage, why: str) -> None:
        """Lose a message; the call that it belongs to fails."""
        if message.channel:
            self.record("drop", message.sender, message, why)
        if message.call is not None:
            self.finish(message.call, None)

    def finish(self, call: ServiceCall, data: bytes | None) -> None:
        """Answer a call, if it still waits; None: it fails."""
        if call.is_over:
            return
        call.is_over = True
        if call in self.calls:
            self.calls.remove(call)
        if call.reply is not None:
            call.reply(data)

    def settle(self, message: RawMessage) -> None:
        """A response to the tester's own question has come: nobody else waits for it."""
        if message.call is not None and message.call.reply is None:
            message.call.is_over = True

    def collect(self, message: RawMessage) -> None:
        """Note that the tester itself takes a message up."""
        self.record("receive", ENVIRONMENT, message)

    def made(self, channel: str, data: bytes) -> RawMessage:
        """Return a message of the tester's own, noted as sent; it goes nowhere yet."""
        return self._message(channel, "", data)

    def inject(self, channel: str, data: bytes, slot: str | None = None) -> RawMessage:
        """Send a message of the tester's own to all who hear the channel, or to one slot."""
        message = self.made(channel, data)
        self.release(message, slot)
        return message

    # The trace.

    def note(self, text: str, component: str = "", time: int | None = None) -> None:
        """Write a remark into the trace, and report it at once."""
        self._tell(TraceEvent(self._now() if time is None else time, "note", component, text=text))
        self.report()

    def record(self, kind: Kind, component: str, message: RawMessage, text: str = "", *, transition: str = "",
               data: bytes | None = None) -> None:  # fmt: skip
        """Write what happened to a message into the trace."""
        payload = self._payload(message)
        if data is not None and data is not message.data:
            payload = replace(payload, content=data)
        when = message.time if kind == "send" else self._now()
        self._tell(TraceEvent(when, kind, component, transition, message.channel, message.number, text, payload))

    def tell(self, kind: Kind, component: str, transition: str = "", text: str = "", time: int | None = None) -> None:
        """Write something else into the trace."""
        self._tell(TraceEvent(self._now() if time is None else time, kind, component, transition, text=text))

    def _tell(self, event: TraceEvent) -> None:
        self.events.append(event)
        self._unreported.append(event)
        if self.reports_at_once:
            self.report()

    def report(self) -> None:
        """Call the listener with what has happened: no message waits for a judge, or until it has been recorded."""
        happened, self._unreported = self._unreported, []
        for event in happened:
            self._listener(event)

    def close(self) -> None:
        """End all calls; what comes later is not heard."""
        self._closed = True
        for call in list(self.calls):
            self.finish(call, None)
        self.agenda.clear()

    def _message(self, channel: str, slot: str, data: bytes, call: ServiceCall | None = None) -> RawMessage:
        message = RawMessage(next(self._numbers), channel, slot, self._name(channel, slot, 0), data, self._now(), call)
        self.record("send", message.sender, message, "" if slot else MADE)
        return message

    def _payload(self, message: RawMessage) -> Raw:
        if message.number not in self._raw:
            if len(self._raw) > 4096:
                self._raw.clear()
            kind = self._kinds(message.channel)  # made without `replace`, which takes as long as the rest of a relay
            self._raw[message.number] = Raw(kind.type, kind.md5, kind.definition, message.data, kind.encoding)
        return self._raw[message.number]

    def _name(self, channel: str, slot: str, end: int) -> str:
        """Return who sends (0) or receives (1) on a channel at a slot, as traces call it."""
        component = self._ends_of.get(channel, ("", ""))[end]
        found = self._slots.get(slot)
        if found is None:
            runs = any(component in one.node.components for one in self.slot_plan.slots)
            return component if component and runs else ENVIRONMENT
        return found.component(component if component in found.node.components else found.name.partition("#")[0])
