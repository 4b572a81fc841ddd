"""Writes a model as SCXML: one machine is the document, several are the regions of a parallel state.

A transition without an event is a choice of the model, but SCXML takes one at once, before all others. So each gets an
event of its own, marked `parcours:tau`, unless it is the only way out of its state. `parcours:transition` keeps ids.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from xml.sax.saxutils import escape, quoteattr

from parcours.model.conversion import Writing
from parcours.model.expression import Expression, Name
from parcours.model.structure import BASE_TYPES, CLOCK, ENVIRONMENT, Cefsm, Component, Machine, Transition
from parcours_formats.guard_languages.javascript import WORDS, JavaScriptWriter, javascript
from parcours_formats.guard_languages.values import FALSE, TRUE, conjunction, literal, naturals_of
from parcours_formats.losses import unsaid
from parcours_formats.naming import UniqueNames, as_identifier
from parcours_formats.scxml.chart import ID, OWN, SILENT

OUTSIDE = "#_external"
"""The target of events that leave the model."""

_RAISED = ("done", "error")
"""How the names of events begin that an SCXML processor raises by itself."""

_WORDS = ("In", "_event", "_name", "_sessionid", "_ioprocessors", "_x")
_HOLDS = frozenset(("actions", "events", "finals", "guards", "ids", "sends", "states", "variables"))


def write(cefsm: Cefsm) -> Writing:
    """Return a model as an SCXML document."""
    writer = _Writer(cefsm)
    text = "\n".join(writer.lines()) + "\n"
    return Writing(text, tuple(sorted({*unsaid(cefsm, _HOLDS), *writer.losses})))


class _Writer(JavaScriptWriter):
    def __init__(self, cefsm: Cefsm) -> None:
        self.cefsm = cefsm
        super().__init__()
        self.machines = [(component, machine) for component in cefsm.components for machine in component.machines]
        self.events = {channel.name: _event(channel.name, channel.topic) for channel in cefsm.channels}
        self.channels = {channel.name: channel for channel in cefsm.channels}
        own, self.ids = UniqueNames((*WORDS, *_WORDS)), UniqueNames()
        self.silent = UniqueNames((*self.events.values(), *_RAISED))
        for component in cefsm.components:
            spoken = self.spoken[component.name] = {}
            for variable in component.variables:
                if variable.type in BASE_TYPES:
                    given = self.renamed("variable", variable.name, own.identifier(variable.name), variable.line)
                    spoken[variable.name] = Name(given)

    def lines(self) -> Iterator[str]:
        """Yield the lines of the document."""
        cefsm, several = self.cefsm, len(self.machines) > 1
        for channel in cefsm.channels:
            if ENVIRONMENT not in (channel.sender, channel.receiver):
                rule = "is an event that the document sends to itself; there is one queue, without bound, for all"
                self.lose(f"channel {channel.name!r}", channel.line, rule)
        if len(cefsm.components) > 1:
            self.lose("model", 0, "its components are the regions of one document, and come back as one component")
        name = cefsm.components[0].name if len(cefsm.components) == 1 else cefsm.name
        if cefsm.name != name:
            self.lose("model", 0, f"its name {cefsm.name!r} is not written")
        yield '<?xml version="1.0" encoding="UTF-8"?>'
        space = f'xmlns="http://www.w3.org/2005/07/scxml" xmlns:parcours="{OWN}" version="1.0" datamodel="ecmascript"'
        head = f"<scxml {space} name={quoteattr(name)}"
        regions = [self.region(component, machine) for component, machine in self.machines]
        yield f"{head}>" if several else f'{head} initial="{regions[0][0]}">'
        data = [line for component in cefsm.components for line in self.data(component)]
        if data:
            yield from ("  <datamodel>", *data, "  </datamodel>")
        if not several:
            yield from regions[0][1]
        else:
            yield f'  <parallel id="{self.ids.identifier("regions")}">'
            for (_, machine), (initial, body) in zip(self.machines, regions, strict=True):
                yield f'  <state id="{self.ids.identifier(machine.name)}" initial="{initial}">'
                yield from body
                yield "  </state>"
            yield "  </parallel>"
        yield "</scxml>"

    def data(self, component: Component) -> Iterator[str]:
        """Yield the data elements of a component."""
        for variable in component.variables:
            name = self.spoken[component.name].get(variable.name)
            if name is None:
                if variable.type != CLOCK:
                    self.lose(f"variable {variable.name!r}", variable.line, "messages are not written")
                continue
            start = variable.initial
            if start is None:
                start = {"bool": False, "int": 0, "real": 0.0}.get(variable.type, next(iter(variable.domain), ""))
            if variable.role == "input":
                self.lose(f"variable {variable.name!r}", variable.line, "is an input; there it keeps its first value")
            yield f'    <data id="{name}" expr={quoteattr(javascript(literal(start)))}/>'

    def region(self, component: Component, machine: Machine) -> tuple[str, list[str]]:
        """Return the id of the initial state of a machine, and the lines of its states."""
        at = {state: self.renamed("state", state, self.ids.identifier(state), machine.line) for state in machine.states}
        leaving = {state: [each for each in machine.transitions if each.source == state] for state in machine.states}
        lines = []
        for state in machine.states:
            final = state in machine.final and not leaving[state] and len(self.machines) == 1
            if state in machine.final and not final:
                self.lose(f"state {state!r}", machine.line, "is not final there: it has transitions, or others go on")
            kind = "final" if final else "state"
            if not leaving[state]:
                lines.append(f'  <{kind} id="{at[state]}"/>')
                continue
            lines.append(f'  <state id="{at[state]}">')
            before: list[tuple[Transition, Expression]] = []
            for transition in leaving[state]:
                guard = conjunction(self.conditions(component, transition))
                self.compare(transition, guard, before)
                before.append((transition, guard))
                alone = len(leaving[state]) == 1 == len(self.machines) and not transition.is_loop
                lines += self.transition(component, transition, guard, at, alone=alone)
            lines.append("  </state>")
        return at[machine.initial], lines

    def compare(self, transition: Transition, guard: Expression, before: list[tuple[Transition, Expression]]) -> None:
        """Note that transitions that stand before another one go first, where both may go."""
        if transition.event is None:
            return
        channel = transition.event.channel
        same = [each for each in before if each[0].event is not None and each[0].event.channel == channel]
        rivals = [other for other, condition in same if conjunction((condition, guard)) != FALSE]
        if rivals:
            first = ", ".join(repr(other.id) for other in rivals[:9])
            rule = f"where {first} can go too, that goes first there, as it stands before it; here either may"
            self.lose(f"transition {transition.id!r}", transition.line, rule)

    def transition(
        self, component: Component, transition: Transition, guard: Expression, at: Mapping[str, str], *, alone: bool
    ) -> Iterator[str]:
        """Yield the lines of a transition; `alone` says that nothing else can happen in its state."""
        parts, event, naturals = [], "", self.naturals(component)
        if transition.event is not None:
            event = self.events[transition.event.channel]
            parts.append(f' event="{event}"')
        elif not alone:
            name = self.silent.identifier(transition.id)
            parts.append(f' event="{name}" parcours:{SILENT}="true"')
            rule = f"waits for the event {name!r} there; only Parcours reads it as a transition without event"
            self.lose(f"transition {transition.id!r}", transition.line, rule)
        if transition.id != f"{at[transition.source]}:{event or 'always'}":
            parts.append(f" parcours:{ID}={quoteattr(transition.id)}")
        if guard != TRUE:
            parts.append(f" cond={quoteattr(javascript(guard, naturals))}")
        body = []
        for target, value in self.assignments(component, transition, "its"):
            body.append(f'      <assign location="{target}" expr={quoteattr(javascript(value, naturals))}/>')
        body += self.sends(transition)
        head = f'    <transition{"".join(parts)} target="{at[transition.target]}"'
        yield from (f"{head}>", *body, "    </transition>") if body else (f"{head}/>",)

    def sends(self, transition: Transition) -> Iterator[str]:
        """Yield an element for each message."""
        for send in transition.sends:
            target = f' target="{OUTSIDE}"' if self.channels[send.channel].receiver == ENVIRONMENT else ""
            yield f'      <send event="{self.events[send.channel]}"{target}/>'

    def naturals(self, component: Component) -> set[str]:
        """Return the variables, as they are called there, that are never negative."""
        spoken = self.spoken[component.name]
        return {str(spoken[name]) for name in naturals_of(component)}

    def renamed(self, what: str, name: str, given: str, line: int) -> str:
        """Return the name given instead of another, noting that it changed."""
        if given != name:
            self.lose(f"{what} {name!r}", line, f"is called {given!r} there")
        return given


def _event(name: str, topic: str) -> str:
    # The name that the event had in the document the model was read from, if it was.
    return escape(topic) if topic and as_identifier(topic) == name and not topic.split()[1:] else name
