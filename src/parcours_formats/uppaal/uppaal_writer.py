"""Writes a model as a UPPAAL file: one template for each machine, one process for each template.

Rendezvous are channels, and a process `Environment` is the tester. A bounded queue is a counter with one array for
each field; an input is a selection at each edge that reads it; a duration is a clock of its machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from math import inf
from xml.sax.saxutils import escape

from parcours.model.conversion import Writing
from parcours.model.expression import Assignment, Expression
from parcours.model.structure import Cefsm, Component, Machine, Transition
from parcours_formats.losses import unsaid
from parcours_formats.naming import UniqueNames, as_identifier
from parcours_formats.uppaal.sharing import TESTER, WORDS, Rendering, Shared, UnsayableError

_HEAD = """<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE nta PUBLIC '-//Uppaal Team//DTD Flat System 1.1//EN'
 'http://www.it.uu.se/research/group/darts/uppaal/flat-1_2.dtd'>
<nta>"""


def write(cefsm: Cefsm) -> Writing:
    """Return a model as a UPPAAL file."""
    shared = Shared(cefsm)
    shared.losses += unsaid(replace(cefsm, components=()), frozenset())
    given, templates = UniqueNames([*WORDS, TESTER]), list[_Template]()
    for component in cefsm.components:
        alone = len(component.machines) == 1
        if component.title:
            where = f"component {component.name!r}"
            shared.losses.add(where, component.line, f"its title {component.title!r} is not written")
        if not alone:
            rule = "its machines come back as components of their own, unless they share variables"
            shared.losses.add(f"component {component.name!r}", component.line, rule)
        for machine in component.machines:
            name = given.identifier(component.name if alone else f"{component.name}_{machine.name}")
            templates.append(_Template(shared, component, machine, name, alone=alone))
    bodies = [line for template in templates for line in template.lines()]
    processes = [template.name for template in templates]
    if meetings := shared.tester():
        processes.append(TESTER)
        bodies += _tester(meetings)
    declared = escape("\n".join(shared.declarations()))
    system = f"\t<system>system {', '.join(processes)};</system>"
    text = "\n".join([_HEAD, f"\t<declaration>{declared}</declaration>", *bodies, system, "</nta>", ""])
    return Writing(text, tuple(sorted(set(shared.losses))))


def _tester(meetings: list[str]) -> Iterator[str]:
    yield f'\t<template>\n\t\t<name>{TESTER}</name>\n\t\t<location id="t"/>\n\t\t<init ref="t"/>'
    for meeting in meetings:
        yield from _edge("t", "t", [("synchronisation", meeting)])
    yield "\t</template>"


class _Template:
    """The template of one machine; `name` is also that of its process."""

    def __init__(self, shared: Shared, component: Component, machine: Machine, name: str, *, alone: bool) -> None:
        self.shared, self.component, self.machine, self.name, self.alone = shared, component, machine, name, alone
        self.rendering, self.lose = shared.rendering(component), shared.losses.add
        leaving: dict[str, list[Transition]] = {}
        for transition in machine.transitions:
            leaving.setdefault(transition.source, []).append(transition)
        self.urgent = {state for state, each in leaving.items() if all(one.duration == (0, 0) for one in each)}
        timed = [each for each in machine.transitions if each.duration and each.source not in self.urgent]
        self.since = shared.names.identifier(f"since_{name}") if timed else ""
        # Ids are unique in the file, not in the template alone.
        self.ids = {state: f"{name}_s{number}" for number, state in enumerate(machine.states)}
        self.between: list[str] = []

    def lines(self) -> Iterator[str]:
        """Yield the lines of the template."""
        machine, invariants = self.machine, dict(self.machine.invariants)
        if machine.name != self.name:
            self.lose(f"machine {machine.name!r}", machine.line, f"is called {self.name!r} there")
        if machine.final:
            self.lose(f"machine {machine.name!r}", machine.line, "its final states are not marked")
        edges = [line for transition in machine.transitions for line in self.edges(transition)]
        declared = list(self.shared.declared(self.component)) if self.alone else []
        declared += [f"clock {self.since};"] if self.since else []
        yield f"\t<template>\n\t\t<name>{self.name}</name>"
        yield f"\t\t<declaration>{escape(chr(10).join(declared))}</declaration>"
        given = [name for own in self.shared.variables.values() for name in own.values()]
        shown = UniqueNames([*WORDS, *given, *(link.name for link in self.shared.links.values())])
        for number, state in enumerate(machine.states):
            name = shown.identifier(state)
            if name != state:
                self.lose(f"state {state!r}", machine.line, f"is called {name!r} there")
            yield f'\t\t<location id="{self.ids[state]}" x="{number % 5 * 220}" y="{number // 5 * 160}">'
            yield f"\t\t\t<name>{name}</name>"
            if state in invariants:
                said = self.said(invariants[state], f"state {state!r}", machine.line, "its invariant", self.rendering)
                yield f'\t\t\t<label kind="invariant">{escape(said)}</label>'
            if state in self.urgent:
                yield "\t\t\t<urgent/>"
            yield "\t\t</location>"
        for id in self.between:
            yield f'\t\t<location id="{id}"><committed/></location>'
        yield f'\t\t<init ref="{self.ids[machine.initial]}"/>'
        yield from edges
        yield "\t</template>"

    def edges(self, transition: Transition) -> Iterator[str]:
        """Yield one edge, or a chain of them through committed locations if the transition meets several others."""
        shared, where, line = self.shared, f"transition {transition.id!r}", transition.line
        taken = transition.event.channel if transition.event is not None else ""
        selected = ", ".join(shared.selections(self.component, transition))
        guards = [*shared.waits(taken, transition.sends), *self.bounds(transition, where)]
        if transition.guard is not None:
            rendering = shared.rendering(self.component, transition, guard=True)
            guards.append(self.said(transition.guard, where, line, "its guard", rendering))
        rendering = shared.rendering(self.component, transition)
        updates = []
        for action in transition.actions:
            target = shared.variables[self.component.name].get(getattr(action, "target", ""))
            if isinstance(action, Assignment) and target is not None:
                if value := self.assigned(action, where, line, rendering):
                    updates.append(f"{target} = {value}")
            else:
                self.lose(where, line, f'its action "{action}" is not written')
        updates += shared.shifted(taken) if taken else []
        for send in transition.sends:
            for slot, part in shared.payload(send):
                if value := self.said(part, where, line, f"what it sends on {send.channel!r}", rendering):
                    updates.append(f"{slot} = {value}")
            updates += [f"{shared.links[send.channel].name}++"] if shared.links[send.channel].capacity else []
        updates += [f"{self.since} = 0"] if self.since else []
        meetings = [f"{shared.links[taken].name}?"] if taken and shared.links[taken].meets else []
        for send in transition.sends:
            link = shared.links[send.channel]
            if link.meets:
                meetings.append(f"{link.name}!")
            elif not link.capacity:
                self.lose(where, line, f"its message on {send.channel!r} is not written: nobody reads it")
        if transition.weight != 1:
            self.lose(where, line, f"its weight {transition.weight} is not written")
        guard = " && ".join(f"({each})" if "||" in each and len(guards) > 1 else each for each in guards if each)
        yield from self.chain(transition, [("select", selected), ("guard", guard)], meetings, ", ".join(updates))

    def chain(
        self, transition: Transition, labels: list[tuple[str, str]], meetings: list[str], update: str
    ) -> Iterator[str]:
        """Yield the edges on which a transition meets one other after the other."""
        #   A --ch1?, all updates--> (committed) --ch2!--> (committed) --ch3!--> B
        # An edge of UPPAAL meets one other; nothing else happens, and no time passes, while a location is committed.
        stops = [self.ids[transition.source]]
        for _ in meetings[1:]:
            self.between.append(f"{self.name}_b{len(self.between)}")
            stops.append(self.between[-1])
        where = f"transition {transition.id!r}"
        if len(meetings) > 1:
            self.lose(where, transition.line, f"meets {len(meetings)} others, and is written as as many edges")
        id = "" if as_identifier(transition.id) != transition.id else f' id="{transition.id}"'
        if not id:
            self.lose(where, transition.line, "its id is not written")
        for at, (source, target) in enumerate(pairwise([*stops, self.ids[transition.target]])):
            meeting = [("synchronisation", meetings[at])] if meetings else []
            # All is done at the first edge: what is sent must stand before it is received.
            if at == 0:
                yield from _edge(source, target, [*labels, *meeting, ("assignment", update)], id)
            else:
                yield from _edge(source, target, meeting)

    def bounds(self, transition: Transition, where: str) -> list[str]:
        """Return the conditions on the clock of the machine that a duration is."""
        if transition.duration is None or transition.source in self.urgent:
            return []
        self.lose(where, transition.line, f"its duration is written as a guard on the clock {self.since!r}")
        found = []
        for sign, bound in zip((">=", "<="), transition.duration, strict=True):
            if sign == "<=" or bound > 0:
                try:
                    found += [f"{self.since} {sign} {self.rendering.constant(bound)}"] if bound < inf else []
                except UnsayableError as error:
                    self.lose(where, transition.line, f"a bound of its duration is not written: {error}")
        return found

    def assigned(self, action: Assignment, where: str, line: int, rendering: Rendering) -> str:
        """Return the text of an assigned value; a clock is set to a number of units of time."""
        try:
            value = getattr(action.value, "value", None)
            if action.target in self.rendering.clocks and isinstance(value, int | float):
                return rendering.constant(value)
        except UnsayableError as error:
            self.lose(where, line, f'its action "{action}" is not written: {error}')
            return ""
        return self.said(action.value, where, line, f"its assignment to {action.target!r},", rendering)

    def said(self, node: Expression, where: str, line: int, what: str, rendering: Rendering) -> str:
        """Return an expression in UPPAAL's C; an empty text, with a loss, if it cannot be said."""
        try:
            return rendering.text(node)
        except UnsayableError as error:
            self.lose(where, line, f'{what} "{node}" is not written: {error}')
            return ""


def _edge(source: str, target: str, labels: Iterable[tuple[str, str]], id: str = "") -> Iterator[str]:
    yield f'\t\t<transition{id}>\n\t\t\t<source ref="{source}"/>\n\t\t\t<target ref="{target}"/>'
    for kind, text in labels:
        if text:
            yield f'\t\t\t<label kind="{kind}">{escape(text)}</label>'
    yield "\t\t</transition>"
