"""Judges the data of a trace by what the model says of it: `ensures:`, invariants, and reported guards and actions.

The order of transitions is judged elsewhere (`run.enforcement`, `verdict.conformance`). Here each event is looked at
with what its component knew: the message that it received, the one that it answers, its variables before and after.

    receive request ---> take p24 ---> send answer           each formula is judged where its last name has a value;
       `request`        `old`, now      `it`, `last`         one with a name nobody told is not judged, and counted so
"""

from __future__ import annotations

import contextlib
import functools
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from parcours.errors import BadModel, BadRequest
from parcours.model.configuration import content_of
from parcours.model.exclusion import excluded
from parcours.model.expression import Assignment, Call, Expression, evaluate, names
from parcours.model.expression.evaluation import Code, compiled
from parcours.model.expression.explaining import explain
from parcours.model.expression.programs import program
from parcours.model.fitting import fitting, misfit
from parcours.model.formulas import Clause, clauses, reverse
from parcours.model.scope import Scopes, is_local
from parcours.model.structure import BASE_TYPES, Cefsm, Component, Machine, Transition
from parcours.run.port import StepReport
from parcours.run.trace import BESIDE, REPEAT, Trace, TraceEvent

View = Callable[[str, object], Mapping[str, object] | None]
"""A payload as the model's message: (channel, payload) -> its fields; None if they cannot be seen.

Raises BadRequest where the payload is not what the model says.
"""


@dataclass(frozen=True, slots=True)
class Violation:
    """The first thing in a trace whose data are not as the model says."""

    event: TraceEvent
    position: int
    """The index of the event in the trace."""
    clause: str
    """What it breaks: `trajectory_response/speed`, `guard of p22`."""
    why: str

    def __str__(self) -> str:
        what, whose = self.event.transition or self.event.channel, self.event.component or "the environment"
        return f"event {self.position}, {what} of {whose}: {self.clause}: {self.why}"


@dataclass(slots=True)
class Tally:
    """How often each clause, guard and action of a model was judged, and how often it could not be."""

    judged: Counter[str] = field(default_factory=Counter)
    unjudged: Counter[str] = field(default_factory=Counter)


_MOST_WAITING = 1000  # messages of a channel that are counted while no transition takes them up


def plain(channel: str, payload: object) -> Mapping[str, object] | None:
    """Return a payload that is a mapping already; None of others."""
    return payload if isinstance(payload, Mapping) else None


@dataclass(slots=True)
class _Instance:
    """What one instance has received, sent and reported so far."""

    values: dict[str, object] = field(default_factory=dict)
    received: dict[str, Mapping[str, object]] = field(default_factory=dict)
    sent: dict[str, Mapping[str, object]] = field(default_factory=dict)
    waiting: dict[str, deque[Mapping[str, object]]] = field(default_factory=dict)
    """Received by channel, and not yet taken up by a transition, as far as can be seen."""
    taken: _Taken | None = None
    """The transition whose messages are not all sent yet."""
    machines: set[str] = field(default_factory=set)
    """Those that have taken a transition."""


@dataclass(slots=True)
class _Taken:
    event: TraceEvent
    position: int
    transition: Transition
    known: dict[str, object]
    awaited: Counter[str]


@functools.lru_cache(maxsize=8)
def contracts_of(cefsm: Cefsm) -> Contracts:
    """Return what a model says of data; the same for equal models."""
    return Contracts(cefsm)


class Contracts:
    """What a model says of data, ready to judge traces of it."""

    def __init__(self, cefsm: Cefsm) -> None:
        self.clauses = tuple(clauses(cefsm))
        self._of: dict[tuple[str, str], list[tuple[Clause, Code]]] = {}
        for clause in self.clauses:
            code = program(clause.formula.condition, clause.id)
            self._of.setdefault((clause.of, clause.owner), []).append((clause, code))
        self.classes = {message.name: message for message in cefsm.messages}
        self._fits = {name: fitting(self.classes, message) for name, message in self.classes.items()}
        self.channels = {channel.name: channel for channel in cefsm.carriers}
        pairs = ((channel.name, reverse(cefsm, channel)) for channel in cefsm.channels)
        self.asked = {name: asked.name for name, asked in pairs if asked is not None}
        # What a model says a message holds, where that can be known: variables that are messages have no value in it.
        carried = {each.name for one in cefsm.components for each in one.variables if each.type not in BASE_TYPES}
        self.sites: dict[tuple[str, str], tuple[Component, Machine, Transition]] = {
            (component.name, each.id): (component, machine, each)
            for component in cefsm.components
            for machine in component.machines
            for each in machine.transitions
        }
        scopes = Scopes(cefsm)
        self.contents = {
            (transition.id, send.channel): tuple(each for each in content.fields if not names(each[1]) & carried)
            for component, _, transition in self.sites.values()
            for send in transition.sends
            for content in [content_of(scopes, self.channels[send.channel].message, component, transition, send)]
        }
        self.excluded: dict[str, list[tuple[str, Expression, Code]]] = {}
        for one, two, guard in (found for each in cefsm.components for found in excluded(each)):
            told = two.id, guard, compiled(guard, f"guard of {two.id}")
            self.excluded.setdefault(one.id, []).append(told)
        self.checks = (*self._checks(),)
        """Everything that can be judged, by name: formulas, guards, actions and messages, in the order of the model."""

    def _checks(self) -> Iterator[str]:
        yield from (clause.id for clause in self.clauses)
        for _, _, transition in self.sites.values():
            if transition.guard is not None:
                yield f"guard of {transition.id}"
            if any(isinstance(each, Assignment) for each in transition.actions):
                yield f"actions of {transition.id}"
            if any(isinstance(each, Call) for each in transition.actions):
                yield f"operations of {transition.id}"
        yield from (f"message {channel} of {id}" for (id, channel), fields in self.contents.items() if fields)

    def misfit(self, channel: str, message: Mapping[str, object]) -> str:
        """Return what in a message is not of the channel's class; empty if nothing is, or the class is not known."""
        declared = self.classes.get(self.channels[channel].message)
        if declared is None or self._fits[declared.name](message):
            return ""
        return misfit(self.classes, declared, message)

    def mask(self, tally: Tally) -> str:
        """Return which checks were made at least once, as a bit for each in hexadecimal."""
        return f"{sum(1 << k for k, check in enumerate(self.checks) if tally.judged[check]):x}"

    def of(self, kind: str, owner: str) -> list[tuple[Clause, Code]]:
        """Return the clauses of a channel, transition or component, each with what evaluates it."""
        return self._of.get((kind, owner), [])

    def judge(self, trace: Trace, view: View = plain) -> tuple[Violation | None, Tally]:
        """Return the first violation in a whole trace, None if there is none, and what was judged."""
        monitor = ContractMonitor(self, view)
        for event in trace.events:
            monitor.observe(event)
        return monitor.finish(), monitor.tally


class ContractMonitor:
    """Follows a trace event by event to its first violation.

    Args:
        view: reads the model's fields from a payload.
    """

    def __init__(self, contracts: Contracts, view: View = plain) -> None:
        self._contracts, self._view = contracts, view
        self._instances: dict[str, _Instance] = {}
        self._seen: dict[int, tuple[object, Mapping[str, object] | None]] = {}
        self._position = -1
        self.violation: Violation | None = None
        self.tally = Tally()

    def observe(self, event: TraceEvent) -> Violation | None:
        """Take note of an event and return the first violation so far."""
        if self.violation is not None:
            return self.violation
        self._position += 1
        if event.kind == "note" and event.text == REPEAT:
            self._instances.clear()
        elif event.kind in ("send", "receive") and event.channel in self._contracts.channels:
            self.violation = next(self._message(event), None)
        elif event.kind == "take":
            self.violation = next(self._take(event), None)
        return self.violation

    def finish(self) -> Violation | None:
        """Take note that the trace is over: judge transitions that have not sent all they must."""
        for instance in self._instances.values():
            if self.violation is None:
                self.violation = next(self._settle(instance), None)
        return self.violation

    def _instance(self, name: str) -> _Instance:
        return self._instances.setdefault(name, _Instance())

    def _message(self, event: TraceEvent) -> Iterator[Violation]:
        try:
            message = self._read(event)
        except BadRequest as error:
            yield Violation(event, self._position, f"message of {event.channel}", error.rule)
            return
        if message is None or not event.component:
            return
        if event.kind == "send" and (wrong := self._contracts.misfit(event.channel, message)):
            yield Violation(event, self._position, f"message of {event.channel}", wrong)
            return
        instance = self._instance(event.component)
        if event.kind == "receive":
            yield from self._settle(instance)
            instance.received[event.channel] = message
            if event.text != BESIDE:
                instance.waiting.setdefault(event.channel, deque(maxlen=_MOST_WAITING)).append(message)
            return
        known = {**instance.values, "it": message, "received": instance.received}
        if event.channel in instance.sent:
            known["last"] = instance.sent[event.channel]
        if (asked := instance.received.get(self._contracts.asked.get(event.channel, ""))) is not None:
            known["request"] = asked
        is_own = event.component.partition("#")[0] == self._contracts.channels[event.channel].sender
        if is_own:
            yield from self._hold("channel", event.channel, known, event, self._position)
        taken = instance.taken
        if taken is not None and taken.awaited[event.channel] > 0:
            yield from self._content(taken, event, message)
            taken.known[event.channel] = message
            taken.awaited[event.channel] -= 1
            if not +taken.awaited:
                yield from self._settle(instance)
        instance.sent[event.channel] = message

    def _content(self, taken: _Taken, event: TraceEvent, message: Mapping[str, object]) -> Iterator[Violation]:
        what = f"message {event.channel} of {taken.transition.id}"
        for name, expression in self._contracts.contents.get((taken.transition.id, event.channel), ()):
            try:
                wanted = evaluate(expression, taken.known, what)
            except BadModel:  # it reads what nobody told
                self.tally.unjudged[what] += 1
                continue
            self.tally.judged[what] += 1
            if message.get(name) != wanted:
                rule = f"{name} must be {expression}, which is {wanted!r}, but is {message.get(name)!r}"
                yield Violation(event, self._position, what, rule)

    def _read(self, event: TraceEvent) -> Mapping[str, object] | None:
        if event.payload is None:
            return None
        seen = self._seen.get(id(event.payload))  # a message is sent, held, released and received: one reading will do
        if seen is None or seen[0] is not event.payload:
            if len(self._seen) > 1000:
                self._seen.clear()
            seen = self._seen[id(event.payload)] = (event.payload, self._view(event.channel, event.payload))
        return seen[1]

    def _take(self, event: TraceEvent) -> Iterator[Violation]:
        site = self._contracts.sites.get((event.component.partition("#")[0], event.transition))
        if site is None:
            return
        component, machine, transition = site
        instance = self._instance(event.component)
        yield from self._settle(instance)
        told = event.payload if isinstance(event.payload, StepReport) else None
        after = {**told.variables} if told is not None else {}
        # An input may have changed since it was last reported, and so may anything where nothing is reported now.
        inputs = {each.name for each in component.variables if each.role == "input"}
        old = {name: value for name, value in instance.values.items() if name not in inputs} if told is not None else {}
        if machine.name not in instance.machines and transition.source == machine.initial:
            initial = {each.name: each.initial for each in component.variables if is_local(each)}
            old = {**{name: value for name, value in initial.items() if name in after}, **old}
        instance.machines.add(machine.name)
        received = {}
        if transition.event is not None and (waiting := instance.waiting.get(transition.event.channel)):
            # Of several that wait, which one it took up is only known to the component.
            if len(waiting) == 1 and transition.event.name:
                received[transition.event.name] = waiting[0]
            waiting.popleft()
        yield from self._step(event, component, transition, old, after, received, told)
        instance.values.update(after)
        known = {**instance.values, **received, "old": old, "last": dict(instance.sent)}
        known["received"] = dict(instance.received)
        awaited = Counter(send.channel for send in transition.sends)
        instance.taken = _Taken(event, self._position, transition, known, awaited)
        yield from self._hold("component", component.name, instance.values, event, self._position)
        if not awaited:
            yield from self._settle(instance)

    def _settle(self, instance: _Instance) -> Iterator[Violation]:
        """Judge the transition taken last, its messages being sent."""
        taken, instance.taken = instance.taken, None
        if taken is not None:
            yield from self._hold("transition", taken.transition.id, taken.known, taken.event, taken.position)

    def _hold(
        self, kind: str, owner: str, known: Mapping[str, object], event: TraceEvent, position: int
    ) -> Iterator[Violation]:
        for clause, code in self._contracts.of(kind, owner):
            if (wrong := self._wrong(clause.id, clause.formula.condition, code, known)) is not None:
                yield Violation(event, position, clause.id, f"{wrong}, so {clause.said} does not hold")

    def _wrong(self, id: str, condition: Expression, code: Code, known: Mapping[str, object]) -> str | None:
        try:
            holds = code(known)
        except BadModel as error:
            if error.slug == "no-value":
                self.tally.unjudged[id] += 1
                return None
            return f"it has no value, since {error.rule}"
        self.tally.judged[id] += 1
        return None if holds else explain(condition, known)

    # What a component reports shows whether it took the transition under its guard, and did its actions:
    #
    #     old ----------------- guard? -- actions ----------------> after
    #     last report, or       inputs and what no action sets:      this report
    #     initial values        as reported now

    def _step(
        self, event: TraceEvent, component: Component, transition: Transition, old: Mapping[str, object],
        after: Mapping[str, object], received: Mapping[str, object], told: StepReport | None,
    ) -> Iterator[Violation]:  # fmt: skip
        assigned = {each.target for each in transition.actions if isinstance(each, Assignment)}
        before = {**old, **{name: value for name, value in after.items() if name not in assigned}, **received}
        guard = transition.guard
        if guard is not None:
            what = f"guard of {transition.id}"
            if (wrong := self._wrong(what, guard, compiled(guard, what), before)) is not None:
                yield Violation(event, self._position, what, f'{wrong}, so "{guard}" does not hold')
        for id, other, code in self._contracts.excluded.get(transition.id, ()):
            with contextlib.suppress(BadModel):  # it reads what nobody told, or has no value
                if code(before):
                    told_of = ", ".join(f"{name} is {before[name]!r}" for name in sorted(names(other)))
                    rule = f'{told_of}, so "{other}" of {id} holds, too, but they exclude each other'
                    yield Violation(event, self._position, f"{transition.id} excludes {id}", rule)
        if told is None:
            if transition.actions:
                self.tally.unjudged[f"actions of {transition.id}"] += 1
            return
        yield from self._actions(event, component, transition, old, before, after)
        calls = tuple(each.name for each in transition.actions if isinstance(each, Call))
        if told.operations is None:
            if calls:
                self.tally.unjudged[f"operations of {transition.id}"] += 1
            return
        self.tally.judged[f"operations of {transition.id}"] += bool(calls)
        if calls != told.operations:
            said = ", ".join(told.operations) or "none"
            rule = f"the model performs {', '.join(calls) or 'none'}, but the component reports {said}"
            yield Violation(event, self._position, f"operations of {transition.id}", rule)

    def _actions(
        self, event: TraceEvent, component: Component, transition: Transition, old: Mapping[str, object],
        before: Mapping[str, object], after: Mapping[str, object],
    ) -> Iterator[Violation]:  # fmt: skip
        what = f"actions of {transition.id}"
        assigned = {each.target for each in transition.actions if isinstance(each, Assignment)}
        wanted, known = {}, dict(before)
        for action in transition.actions:
            if isinstance(action, Assignment):
                try:
                    known[action.target] = wanted[action.target] = evaluate(action.value, known, what)
                except BadModel:  # it reads what nobody told
                    known.pop(action.target, None)
                    wanted.pop(action.target, None)
                    self.tally.unjudged[what] += 1
        for variable in component.variables:
            name = variable.name
            if name not in after or variable.type not in BASE_TYPES:
                continue
            if name in wanted:
                self.tally.judged[what] += 1
                if after[name] != wanted[name]:
                    rule = f"{name} must be {wanted[name]!r} after it, but is reported as {after[name]!r}"
                    yield Violation(event, self._position, what, rule)
            elif is_local(variable) and name in old and name not in assigned and after[name] != old[name]:
                rule = f"it leaves {name} at {old[name]!r}, but the component reports {after[name]!r}"
                yield Violation(event, self._position, what, rule)


def judged(checks: Sequence[str], masks: Iterable[str]) -> dict[str, bool]:
    """Return of each check whether any of the masks has it.

    >>> judged(("a", "b", "c"), ("1", "4"))
    {'a': True, 'b': False, 'c': True}
    """
    whole = 0
    for mask in masks:
        whole |= int(mask or "0", 16)
    return {check: bool(whole >> k & 1) for k, check in enumerate(checks)}
