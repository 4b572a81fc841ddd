"""Finds what is wrong with a model: names, directions and types here, doubtful choices in `linting`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

from parcours.errors import BadModel
from parcours.model.declarations import temporal_findings, variable_findings
from parcours.model.exclusion import MAX_PAIRS, exclusion_findings
from parcours.model.expression import BOOL, Assignment, Expression, Type, type_of
from parcours.model.expression.typing import accepts
from parcours.model.finding import Finding, advice, errors_among
from parcours.model.formulas import clauses
from parcours.model.linting import suspicions
from parcours.model.nodes import is_identifier, is_label
from parcours.model.scope import Scopes, variable_type
from parcours.model.solutions import Budget
from parcours.model.structure import BASE_TYPES, ENVIRONMENT, Cefsm, Component, Machine, Transition, Variable


def findings(cefsm: Cefsm, origin: str = "") -> list[Finding]:
    """Return everything that is wrong or doubtful, in the order of the lines.

    Args:
        cefsm: any model, also one that was not read from a file.
        origin: what to call the file; by default where the model was read from.
    """
    check = _checked(cefsm, origin)
    found = check.findings
    # What a duplicate name refers to is not known, so nothing is searched for behind it.
    if all(finding.rule not in ("duplicate", "name") for finding in found):
        found += suspicions(cefsm, check.origin, check.unsound)
    return _in_order(found)


def errors(cefsm: Cefsm, origin: str = "") -> list[Finding]:
    """Return what is wrong, in the order of the lines, without looking for what is doubtful, which takes longer."""
    return _in_order(_checked(cefsm, origin).findings)


def _checked(cefsm: Cefsm, origin: str) -> _Check:
    check = _Check(cefsm, origin or cefsm.source or cefsm.name)
    check.everything()
    check.findings += temporal_findings(cefsm, check.origin)
    return check


def _in_order(found: Iterable[Finding]) -> list[Finding]:
    return sorted(found, key=lambda finding: (finding.line, finding.rule, finding.message))


class _Check:
    """Collects errors. `unsound` holds the ids of transitions whose guards mean nothing."""

    def __init__(self, cefsm: Cefsm, origin: str) -> None:
        self.cefsm, self.origin = cefsm, origin
        self.findings: list[Finding] = []
        self.unsound: set[str] = set()
        self.scopes, self.budget = Scopes(cefsm), Budget()
        self.classes = self.scopes.classes
        self.channels = {channel.name: channel for channel in cefsm.channels}
        self.components = [component.name for component in cefsm.components]
        self.lonely = {component.name for component in cefsm.components if len(component.machines) == 1}

    def error(self, line: int, rule: str, message: str, remedy: str = "") -> None:
        self.findings.append(Finding(self.origin, line, "error", rule, message, remedy))

    def advice(self, given: str, known: Sequence[str]) -> str:
        return advice(given, known, self.findings)

    def everything(self) -> None:
        self.names()
        self.messages()
        self.links()
        self.interactions()
        self.formulas()
        for component in self.cefsm.components:
            for variable in component.variables:
                self.findings += variable_findings(component.name, variable, list(self.classes), self.origin)
            for machine in component.machines:
                self.machine(machine)
                for transition in machine.transitions:
                    self.communication(component, transition)
                    self.computation(component, transition)
                self.exclusion(component, machine)

    def names(self) -> None:
        model = self.cefsm
        if not model.components:
            self.error(0, "no-component", "a model must have a component, but this one has none", "add one")
        if not is_label(model.name):
            self.error(0, "name", f"the name of a model must be one printable line, but is {model.name!r}")
        self.distinct("component", ((each.name, each.line) for each in model.components))
        self.distinct("channel", ((each.name, each.line) for each in model.carriers))
        self.distinct("message class", ((each.name, each.line) for each in model.messages))
        self.distinct("interaction", ((name, 0) for name, _ in model.interactions), free=True)
        for message in model.messages:
            self.distinct(f"field of {message.name}", ((each.name, message.line) for each in message.fields))
        for component in model.components:
            owner = component.name
            self.distinct(f"variable of {owner}", ((each.name, each.line) for each in component.variables))
            self.distinct(f"machine of {owner}", ((each.name, each.line) for each in component.machines), free=True)
            if not component.machines:
                self.error(component.line, "no-machine", f"a component must have a machine, but {owner!r} has none")
            for machine in component.machines:
                what = f"state of {machine.name}"
                self.distinct(what, ((state, machine.line) for state in machine.states), free=True)
        ids = ((each.id, each.line) for component in model.components for each in component.transitions())
        self.distinct("transition", ids, free=True)

    def distinct(self, what: str, named: Iterable[tuple[str, int]], *, free: bool = False) -> None:
        first: dict[str, int] = {}
        for name, line in named:
            if not (is_label if free else is_identifier)(name):
                self.error(line, "name", f"the name of a {what} must be well formed, but is {name!r}")
            if what == "component" and name == ENVIRONMENT:
                rule = f"{ENVIRONMENT!r} is the tester, but here a component has that name"
                self.error(line, "name", rule, "call it otherwise")
            if name in first:
                before = f" (line {first[name]})" if first[name] else ""
                rule = f"each {what} must have a name of its own, but {name!r} was used before{before}"
                self.error(line, "duplicate", rule, "rename one")
            first.setdefault(name, line)

    def messages(self) -> None:
        known = [*BASE_TYPES, *self.classes]
        inside: dict[str, list[str]] = {}
        for message in self.cefsm.messages:
            for each in message.fields:
                if each.type not in known:
                    what = f"{message.name}.{each.name}"
                    rule = f"a field has a base type or a message class, but {what!r} is {each.type!r}"
                    self.error(message.line, "unknown-message", rule, self.advice(each.type, known))
                elif not each.shape:
                    inside.setdefault(message.name, []).append(each.type)
        for message in self.cefsm.messages:
            # A field with a shape is a list, which may be empty and so ends the nesting.
            reached, border = set(), list(inside.get(message.name, ()))
            while border:
                if (name := border.pop()) not in reached:
                    reached.add(name)
                    border += inside.get(name, ())
            if message.name in reached:
                rule = f"a message has finite size, but {message.name!r} contains itself"
                self.error(message.line, "message-cycle", rule, "give the field a shape, so that it is a list")

    def links(self) -> None:
        for channel in self.cefsm.carriers:
            for end in (channel.sender, channel.receiver):
                if end != ENVIRONMENT and end not in self.components:
                    rule = f"channel {channel.name!r} must link components, but {end!r} is not one"
                    advice = self.advice(end, [ENVIRONMENT, *self.components])
                    self.error(channel.line, "unknown-component", rule, advice)
            if channel.sender == channel.receiver == ENVIRONMENT:
                rule = f"channel {channel.name!r} must touch a component, but both its ends are the environment"
                self.error(channel.line, "channel-ends", rule, "delete it")
            if channel.message not in self.classes:
                rule = f"channel {channel.name!r} must carry a message class, but {channel.message!r} is not one"
                self.error(channel.line, "unknown-message", rule, self.advice(channel.message, list(self.classes)))
            if channel.capacity == 0 and channel.sender == channel.receiver and channel.sender in self.lonely:
                rule = f"a rendezvous joins two machines, but {channel.name!r} has both ends at one"
                self.error(channel.line, "rendezvous", rule, "give the channel a capacity")
            if channel.capacity < 0:
                rule = f"the capacity of channel {channel.name!r} must be 0 or more, but is {channel.capacity}"
                self.error(channel.line, "value", rule)

    def interactions(self) -> None:
        linked = {(channel.sender, channel.receiver) for channel in self.cefsm.channels}
        lines = self.cefsm.interaction_lines or (0,) * len(self.cefsm.interactions)
        for (name, path), line in zip(self.cefsm.interactions, lines, strict=True):
            if len(path) < 2:
                rule = f"interaction {name!r} must visit two components or more, but visits {len(path)}"
                self.error(line, "interaction", rule)
            for visited in dict.fromkeys(path):
                if visited not in self.components:
                    rule = f"interaction {name!r} must visit components, but {visited!r} is not one"
                    self.error(line, "unknown-component", rule, self.advice(visited, self.components))
            for here, there in dict.fromkeys(pairwise(path)):
                if {here, there} <= set(self.components) and (here, there) not in linked:
                    rule = f"{name!r} must follow channels, but none leads from {here!r} to {there!r}"
                    self.error(line, "interaction", rule, "add the channel or leave out the step")

    def formulas(self) -> None:
        # What refers to something unknown is reported there; its formulas are not looked at before.
        if errors_among(self.findings):
            return
        for clause in clauses(self.cefsm):
            where, line = f"{clause.formula.name!r} of {clause.owner!r}", clause.formula.line
            try:
                given = type_of(clause.formula.condition, clause.types, clause.classes, where)
            except BadModel as error:
                self.error(line, error.slug, f"{where}: {error.rule}", error.remedy)
                continue
            if given != BOOL:
                self.error(line, "type", f'{where}: it must be bool, but "{clause.formula.condition}" is {given}')

    def machine(self, machine: Machine) -> None:
        known = set(machine.states)
        ends = [(transition.source, transition.line) for transition in machine.transitions]
        ends += [(transition.target, transition.line) for transition in machine.transitions]
        for state, line in dict.fromkeys([(machine.initial, machine.line), *ends]):
            if state not in known:
                rule = f"{state!r} must be a state of {machine.name!r}, but is not among its 'states'"
                self.error(line, "unknown-state", rule, self.advice(state, machine.states))

    def exclusion(self, component: Component, machine: Machine) -> None:
        known = {each.id: each for each in machine.transitions}
        for group in machine.exclusive:
            unknown = [id for id in group if id not in known]
            for id in unknown:
                rule = f"{id!r} must be a transition of {machine.name!r}, but is not one"
                self.error(machine.line, "unknown-transition", rule, self.advice(id, list(known)))
            if unknown:
                continue
            states = list(dict.fromkeys(known[id].source for id in group))
            if len(set(group)) < 2 or len(states) > 1:
                given = f"leave {' and '.join(states)}" if len(states) > 1 else f"are {len(set(group))}"
                rule = "transitions that exclude each other must be two or more that leave one state"
                self.error(machine.line, "exclusive", f"{rule}, but {', '.join(group) or 'these'} {given}")
        if sum(len(group) * (len(group) - 1) // 2 for group in machine.exclusive) > MAX_PAIRS:
            rule = f"at most {MAX_PAIRS} pairs of transitions exclude each other, but {machine.name!r} names more"
            self.error(machine.line, "exclusive", rule, "split the machine")
        # Other errors are reported first: guards of unknown names cannot be asked.
        if not errors_among(self.findings):
            self.findings += exclusion_findings(self.scopes, component, machine, self.origin, self.budget)

    def communication(self, component: Component, transition: Transition) -> None:
        used = [(send.channel, "sends on") for send in transition.sends]
        if transition.event is not None:
            used.insert(0, (transition.event.channel, "receives from"))
        for name, verb in used:
            channel = self.channels.get(name)
            if channel is None:
                rule = f"{transition.id!r} {verb} a channel, but {name!r} is not one"
                self.error(transition.line, "unknown-channel", rule, self.advice(name, list(self.channels)))
                continue
            owner = channel.sender if verb == "sends on" else channel.receiver
            if owner != component.name:
                rule = f"{transition.id!r} {verb} {name!r}, but that end of the channel belongs to {owner!r}"
                self.error(transition.line, "direction", rule, f"let {owner} do it, or turn the channel round")
        meetings = [name for name, _ in used if name in self.channels and self.is_meeting(name)]
        if len(meetings) > 1:
            both = " and ".join(meetings)
            rule = f"a transition meets one partner, but {transition.id!r} has rendezvous on {both}"
            self.error(transition.line, "rendezvous", rule, "split it, or give the channels a capacity")
        if transition.event is not None and transition.event.name:
            self.own_name(component, transition, transition.event.name)

    def own_name(self, component: Component, transition: Transition, binder: str) -> None:
        # Two transitions of one component that meet take place in one step, and may not call two messages the same.
        sent = {
            send.channel for send in transition.sends if send.channel in self.channels and self.is_meeting(send.channel)
        }
        for other in component.transitions() if sent else ():
            if other.event is not None and other.event.channel in sent and other.event.name == binder:
                rule = f"{transition.id!r} meets {other.id!r} in its own component, but both call a message {binder!r}"
                self.error(transition.line, "shadowed-name", rule, "rename one")

    def is_meeting(self, name: str) -> bool:
        channel = self.channels[name]
        return channel.capacity == 0 and ENVIRONMENT not in (channel.sender, channel.receiver)

    def computation(self, component: Component, transition: Transition) -> None:
        types = self.scopes.types(component.name, transition)
        variables = {variable.name: variable for variable in component.variables}
        if transition.event is not None and transition.event.name in variables:
            binder = transition.event.name
            rule = f"the message of {transition.id!r} needs a name of its own, but {binder!r} is a variable"
            self.error(transition.line, "shadowed-name", rule, "rename one")
        if transition.guard is not None:
            given = self.typed(transition, transition.guard, types, f"guard of {transition.id!r}")
            if given is None:
                self.unsound.add(transition.id)
            elif given != BOOL:
                rule = f'guard of {transition.id!r}: a guard must be bool, but "{transition.guard}" is {given}'
                self.error(transition.line, "type", rule)
                self.unsound.add(transition.id)
        for action in transition.actions:
            where = f"action of {transition.id!r}"
            if isinstance(action, Assignment):
                self.assignment(transition, action, types, variables)
            else:
                self.all_typed(transition, action.arguments, types, where)
        for send in transition.sends:
            self.all_typed(transition, send.payload, types, f"message of {transition.id!r}")

    def assignment(
        self, transition: Transition, action: Assignment, types: Mapping[str, Type], variables: dict[str, Variable]
    ) -> None:
        where = f"action of {transition.id!r}"
        given = self.typed(transition, action.value, types, where)
        target = variables.get(action.target)
        if target is None:
            rule = f"{where}: only a variable of the component can be assigned, but {action.target!r} is not one"
            self.error(transition.line, "unknown-name", rule, self.advice(action.target, list(variables)))
        elif target.role == "input":
            rule = f"{where}: an input is set by the environment, but {action.target!r} is assigned"
            self.error(transition.line, "assigned-input", rule, "make its role local")
        elif given is not None and not accepts(variable_type(target), given):
            rule = f'{where}: {action.target!r} is {variable_type(target)}, but "{action.value}" is {given}'
            self.error(transition.line, "type", rule)

    def all_typed(
        self, transition: Transition, values: Sequence[Expression], types: Mapping[str, Type], where: str
    ) -> None:
        for value in values:
            self.typed(transition, value, types, where)

    def typed(self, transition: Transition, value: Expression, types: Mapping[str, Type], where: str) -> Type | None:
        try:
            return type_of(value, types, self.classes, where)
        except BadModel as error:
            self.error(transition.line, error.slug, f"{where}: {error.rule}", error.remedy)
            return None
