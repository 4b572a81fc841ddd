"""Follows what foreign nodes send and are given, event by event, to where each first leaves the model.

Seen from outside, a node's messages on different topics may come in another order than it sent them, and a message
counts as received when it was handed over, which is before the node takes it up. So each component is followed by
itself, through its own messages, and one that comes too early waits a moment for those that may have been first.
"""

from __future__ import annotations

import functools
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import replace

from parcours.errors import HostFailure
from parcours.model.structure import Cefsm, Component, Transition
from parcours.run.binding import Compiled
from parcours.run.binding.decoding import Decoder
from parcours.run.binding.in_transit import BEGINS, CONTINUED, MADE, STALLED, STOPPED
from parcours.run.binding.structure import Binding
from parcours.run.recording import Raw
from parcours.run.trace import Kind, TraceEvent
from parcours.verdict.conformance import Checker, TraceDeviation

SLACK = 500_000_000
"""How much later a message may arrive that was sent first, on another topic [ns]."""


def _is_inert(transition: Transition) -> bool:
    """Whether it only takes a message up: whether, and how often, it was taken then makes no difference."""
    return transition.is_loop and not (transition.guard or transition.actions or transition.sends)


@functools.lru_cache(maxsize=4)  # what was computed of a model is kept as long as the model
def visible(binding: Binding) -> Cefsm:
    """Return the model without what the binding does not bind: such messages come and go unseen."""
    bound = {channel.name for channel in binding.channels if channel.role == "model"}
    model = binding.model

    def seen(transition: Transition) -> Transition:
        sends = tuple(send for send in transition.sends if send.channel in bound)
        if transition.event is None or transition.event.channel in bound:
            return replace(transition, sends=sends)
        return replace(transition, sends=sends, event=None, guard=None, actions=())

    def of(component: Component) -> Component:
        whole = replace(component, machines=tuple(
            replace(one, transitions=tuple(map(seen, one.transitions))) for one in component.machines
        ))  # fmt: skip
        read = {one.event.channel for one in whole.transitions() if one.event is not None and not _is_inert(one)}
        kept = tuple(
            replace(one, transitions=tuple(
                each for each in one.transitions
                if not (_is_inert(each) and each.event is not None and each.event.channel not in read)
            ))
            for one in whole.machines
        )  # fmt: skip
        busy = tuple(one for one in kept if one.transitions)
        return replace(whole, machines=busy or whole.machines)

    components = tuple(map(of, model.components))
    channels = tuple(channel for channel in model.channels if channel.name in bound)
    return replace(model, components=components, channels=channels, interactions=(), interaction_lines=())


class _Followed:
    """One component of the trace."""

    def __init__(self, name: str, cefsm: Cefsm, quiescence: Mapping[str, int], fields: _Fields) -> None:
        self.name, self._base = name, name.partition("#")[0]
        sends = {channel.name for channel in cefsm.channels if channel.sender == self._base}
        own = {channel: time for channel, time in quiescence.items() if channel in sends}
        self.checker = Checker(cefsm, component=self._base, observes="messages", quiescence=own, fields=fields)
        self._number = 0
        self._waiting: deque[tuple[int, TraceEvent]] = deque()  # since when, in its own time
        self._stopped: int | None = 0  # nothing is owed before the case begins
        self._away = self._last = 0

    def stop(self, now: int) -> None:
        """Nothing is owed from now on [ns]."""
        self._stopped = now if self._stopped is None else self._stopped

    def go_on(self, now: int) -> None:
        """It is."""
        if self._stopped is not None:
            self._away += now - self._stopped
            self._stopped = None

    def _own(self, now: int) -> int:
        """Return the time without what it was stopped for [ns]; it never runs backwards."""
        self._last = max(self._last, (now if self._stopped is None else min(now, self._stopped)) - self._away)
        return self._last

    def skip(self, time: int) -> None:
        """For so long [ns], from now on, it could not do anything."""
        self._away += time if self._stopped is None else 0

    def receive(self, event: TraceEvent) -> None:
        """Note what it was given."""
        self.expire(event.time)
        self._pass("", self._base, event)
        self._try_again(event.time)

    def send(self, event: TraceEvent) -> None:
        """Note what it sent."""
        self.expire(event.time)
        if any(one.channel == event.channel for _, one in self._waiting) or not self._may_come(event):
            self._waiting.append((self._own(event.time), event))
        else:
            self._pass(self._base, "", event)
        self._try_again(event.time)

    def expire(self, now: int) -> None:
        """See whether something did not come, or came without being expected, by now [ns]."""
        while self._waiting and self._own(now) - self._waiting[0][0] > SLACK:
            self._pass(self._base, "", self._waiting.popleft()[1], now)
        if not self._waiting:
            self.checker.quiet(self._own(now))

    def deviation(self) -> TraceDeviation | None:
        """Return the first deviation, at the time of the trace."""
        found = self.checker.deviation
        return None if found is None else replace(found, component=self.name, time=found.time + self._away)

    def _may_come(self, event: TraceEvent) -> bool:
        return any(one.what == "send" and one.name == event.channel for one in self.checker.expected())

    def _try_again(self, now: int) -> None:
        again = True
        while again:
            again = False
            seen: set[str] = set()
            for since, one in list(self._waiting):
                if one.channel not in seen and self._may_come(one):
                    self._waiting.remove((since, one))
                    self._pass(self._base, "", one, now)
                    again = True
                    break
                seen.add(one.channel)

    def _pass(self, sender: str, receiver: str, event: TraceEvent, now: int | None = None) -> None:
        self._number += 1
        time = self._own(event.time if now is None else now)
        ends: tuple[tuple[Kind, str], ...] = ("send", sender), ("receive", receiver)
        for kind, who in ends:
            said = event.transition, event.channel, self._number, event.text, event.payload
            self.checker.observe(TraceEvent(time, kind, who, *said))


class _Fields:
    """Reads the fields of a model's message from the raw one."""

    def __init__(self, compiled: Compiled, decoder: Decoder) -> None:
        self._readings, self._decoder = compiled.fields, decoder
        self.error: HostFailure | None = None

    def can_read(self, channel: str, payload: object) -> bool:
        """Return whether all fields of a message can be read; no complaint is kept."""
        before = self.error
        self(channel, payload)
        is_fine, self.error = self.error is before, before
        return is_fine

    def __call__(self, channel: str, payload: object) -> Mapping[str, object] | None:
        readings = self._readings.get(channel)
        if not readings or not isinstance(payload, Raw):
            return None
        try:
            messages = {channel: self._decoder.message(channel, payload.content)}
            return {name: reading.value(messages) for name, reading in readings.items()}
        except HostFailure as error:
            self.error = self.error or error
            return None


class Conformers:
    """Follows the components of a system.

    Args:
        compiled: the binding.
        names: of the components, as the trace calls them.
        decoder: reads messages; used by nobody else, since another thread may follow.
    """

    def __init__(self, compiled: Compiled, names: Iterable[str], decoder: Decoder) -> None:
        binding = compiled.binding
        cefsm = visible(binding)
        bound = [channel for channel in binding.channels if channel.role == "model"]
        quiescence = {channel.name: round(channel.quiescence * 1e9) for channel in bound}
        self._fields = _Fields(compiled, decoder)
        known = {component.name for component in cefsm.components}
        self._followed = {
            name: _Followed(name, cefsm, quiescence, self._fields)
            for name in names if name.partition("#")[0] in known
        }  # fmt: skip
        self._channels = set(quiescence)
        self._unreadable: set[int] = set()

    @property
    def error(self) -> HostFailure | None:
        """The first message of which a field could not be read."""
        return self._fields.error

    def take(self, event: TraceEvent | int) -> None:
        """Take note of the next event; of a time [ns], that nothing else happened until then."""
        if isinstance(event, int):
            for each in self._followed.values():
                each.expire(event)
            return
        if event.kind == "note" and event.text == BEGINS:
            for each in self._followed.values():
                each.go_on(event.time)
        if event.kind == "note" and event.text.startswith(STALLED):
            for each in self._followed.values():
                each.skip(int(event.text.removeprefix(STALLED)))
        if event.kind == "send" and event.text == MADE and not self._fields.can_read(event.channel, event.payload):
            self._unreadable.add(event.message)
        followed = self._followed.get(event.component)
        if followed is None:
            return
        if event.message in self._unreadable:
            event = replace(event, payload=None)
        if event.kind == "note":
            if event.text == STOPPED:
                followed.stop(event.time)
            elif event.text == CONTINUED:
                followed.go_on(event.time)
        elif event.channel in self._channels:
            if event.kind == "send":
                followed.send(event)
            elif event.kind == "receive":
                followed.receive(event)

    @property
    def deviations(self) -> tuple[TraceDeviation, ...]:
        """The first deviation of each component that deviated, in order of time."""
        found = (followed.deviation() for followed in self._followed.values())
        return tuple(sorted((one for one in found if one is not None), key=lambda one: one.time))
