"""What of a model a format cannot say: one loss for each thing that it leaves out."""

from __future__ import annotations

import re
from collections.abc import Iterator, Set

from parcours.model.conversion import Loss
from parcours.model.structure import CLOCK, Cefsm, Machine, Transition, Variable


class Losses(list[Loss]):
    """What a conversion leaves out or changes, noted on the way."""

    def add(self, where: str, line: int, what: str, *, alters: bool = False) -> None:
        """Note one loss, as `Loss`."""
        self.append(Loss(where, line, what, alters))


ASPECTS = frozenset(
    re.findall(r"\w+", "actions durations events finals guards ids payloads sends states tags texts variables weights")
)
"""What a format may have words for. `ids` and `states` are names; `texts` the doc and titles of a model."""


def unsaid(cefsm: Cefsm, holds: Set[str]) -> Iterator[Loss]:
    """Yield what a format leaves out of a model; `holds` are those of ASPECTS that it has words for.

    >>> from parcours.model import Component, Transition
    >>> light = Machine("light", "off", ("off",), (Transition("tick", "off", "off", duration=(1.0, 2.0)),))
    >>> print(*unsaid(Cefsm("lamp", (Component("Lamp", (light,)),)), ASPECTS - {"durations"}))
    transition 'tick': its duration of 1.0 to 2.0 s is not written
    """
    lacks = ASPECTS - holds
    if cefsm.doc and "texts" in lacks:
        yield Loss("doc", 0, "the sentence about the model is not written")
    if cefsm.serialisation:
        yield Loss("serialisation", 0, f"the policy {cefsm.serialisation!r} is not written")
    for name, _ in cefsm.interactions:
        yield Loss(f"interaction {name!r}", 0, "specified interactions are not written")
    for channel in cefsm.channels:
        if channel.ensures:
            yield Loss(f"channel {channel.name!r}", channel.line, "what must hold of its messages is not written")
    for signal in cefsm.signals:
        yield Loss(f"signal {signal.name!r}", signal.line, "what travels outside transitions is not written")
    for component in cefsm.components:
        if component.invariants:
            yield Loss(f"component {component.name!r}", component.line, "its invariants are not written")
        if component.title and "texts" in lacks:
            yield Loss(f"component {component.name!r}", component.line, f"its title {component.title!r} is not written")
        for variable in component.variables:
            yield from _of_variable(variable, f"variable '{component.name}.{variable.name}'", lacks)
        for machine in component.machines:
            yield from _of_machine(machine, lacks)
            for transition in machine.transitions:
                yield from _of_transition(transition, lacks)


def _of_variable(variable: Variable, where: str, lacks: Set[str]) -> Iterator[Loss]:
    if "variables" in lacks:
        yield Loss(where, variable.line, "variables are not written")
        return
    if variable.unit != "1":
        yield Loss(where, variable.line, f"its unit {variable.unit!r} is not written")
    if variable.type == CLOCK:
        yield Loss(where, variable.line, "clocks are not written")
    elif isinstance(variable.domain, range):
        yield Loss(where, variable.line, f"its range {variable.domain[0]} to {variable.domain[-1]} is not written")
    elif variable.domain:
        yield Loss(where, variable.line, "its values are not listed")


def _of_machine(machine: Machine, lacks: Set[str]) -> Iterator[Loss]:
    where = f"machine {machine.name!r}"
    if machine.final and "finals" in lacks:
        yield Loss(where, machine.line, f"its final states {', '.join(map(repr, machine.final))} are not marked")
    for state, invariant in machine.invariants:
        yield Loss(f"state {state!r}", machine.line, f'its invariant "{invariant}" is not written')
    for group in machine.exclusive:
        yield Loss(where, machine.line, f"that {' and '.join(group)} exclude each other is not written")
    for state, tag in machine.tags if "tags" in lacks else ():
        yield Loss(f"state {state!r}", machine.line, f"its tag {tag!r} is not written")
    if "states" in lacks:
        yield Loss(where, machine.line, "states have numbers; their names are not written")
    if "ids" in lacks:
        yield Loss(where, machine.line, "transitions have no names of their own; theirs are not written")


def _of_transition(transition: Transition, lacks: Set[str]) -> Iterator[Loss]:
    where = f"transition {transition.id!r}"
    if transition.guard is not None and "guards" in lacks:
        yield Loss(where, transition.line, f'its guard "{transition.guard}" is not written')
    if transition.actions and "actions" in lacks:
        yield Loss(where, transition.line, f'its action "{"; ".join(map(str, transition.actions))}" is not written')
    if transition.event is not None and "events" in lacks:
        what = f"its event {transition.event.channel!r} is not written; it needs none there"
        yield Loss(where, transition.line, what)
    for send in transition.sends:
        if "sends" in lacks:
            yield Loss(where, transition.line, f"its message {send.channel!r} is not written")
        elif send.payload and "payloads" in lacks:
            said = ", ".join(map(str, send.payload))
            yield Loss(where, transition.line, f'what it sends on {send.channel!r}, "{said}", is not written')
    if transition.ensures:
        yield Loss(where, transition.line, "what must hold after it is not written")
    if transition.duration is not None and "durations" in lacks:
        least, most = transition.duration
        yield Loss(where, transition.line, f"its duration of {least} to {most} s is not written")
    for tag in transition.tags if "tags" in lacks else ():
        yield Loss(where, transition.line, f"its tag {tag!r} is not written")
    if transition.weight != 1 and "weights" in lacks:
        yield Loss(where, transition.line, f"its weight {transition.weight} is not written")
