"""Warns of what a model says but perhaps does not mean: reachability, choice and communication."""

from __future__ import annotations

from collections.abc import Iterable, Set
from itertools import combinations, islice

from parcours.model.exclusion import MAX_PAIRS, together
from parcours.model.expression import Expression
from parcours.model.finding import Finding
from parcours.model.scope import Scopes
from parcours.model.solutions import Answer, Budget, Question
from parcours.model.structure import ENVIRONMENT, Cefsm, Component, Machine, Transition


def suspicions(cefsm: Cefsm, origin: str, unsound: Set[str] = frozenset()) -> list[Finding]:
    """Return the warnings of a model."""
    search = _Search(cefsm, origin, unsound)
    search.channels()
    for component in cefsm.components:
        for machine in component.machines:
            search.machine(component, machine)
    return search.findings


class _Search:
    def __init__(self, cefsm: Cefsm, origin: str, unsound: Set[str]) -> None:
        self.cefsm, self.origin, self.unsound = cefsm, origin, unsound
        self.findings: list[Finding] = []
        self.scopes = Scopes(cefsm)
        self.budget = Budget()  # one for the whole model, so that a hostile one costs bounded time

    def warn(self, line: int, rule: str, message: str, remedy: str = "") -> None:
        self.findings.append(Finding(self.origin, line, "warning", rule, message, remedy))

    def channels(self) -> None:
        transitions = [each for component in self.cefsm.components for each in component.transitions()]
        read = {transition.event.channel for transition in transitions if transition.event is not None}
        written = {send.channel for transition in transitions for send in transition.sends}
        for channel in self.cefsm.channels:
            if channel.receiver != ENVIRONMENT and channel.name not in read:
                rule = f"a channel must be read, but no event of {channel.receiver!r} receives {channel.name!r}"
                remedy = f"add an event, or let it lead to: {ENVIRONMENT}"
                self.warn(channel.line, "unread-channel", rule, remedy)
            if channel.sender != ENVIRONMENT and channel.name not in written:
                rule = f"a channel must be written, but {channel.sender!r} never sends {channel.name!r}"
                remedy = f"add a message, or let it come from: {ENVIRONMENT}"
                self.warn(channel.line, "unwritten-channel", rule, remedy)

    def machine(self, component: Component, machine: Machine) -> None:
        place = f"{machine.name!r} in {component.name!r}"
        dead = self.constantly_false(component, machine)
        alive = [transition for transition in machine.transitions if transition.id not in dead]
        reached = _closure(machine.initial, ((each.source, each.target) for each in alive))
        # A closed test path starts and ends in the initial state, so what leads nowhere back is in no test.
        homing = _closure(machine.initial, ((each.target, each.source) for each in alive))
        for state in machine.states:
            if state not in reached:
                rule = f"every state must be reachable, but no path leads to {state!r} of {place}"
                self.warn(machine.line, "unreachable-state", rule, "add a transition to it, or delete it")
            elif state not in homing:
                rule = f"every state must lead back to {machine.initial!r}, but {state!r} of {place} does not"
                self.warn(machine.line, "no-way-back", rule, "no closed test path visits it; add a transition")
        for transition in machine.transitions:
            if transition.source not in reached and transition.id not in dead:
                start = transition.source
                rule = f"a transition must be possible, but {transition.id!r} starts in {start!r}, never reached"
                self.warn(transition.line, "dead-transition", rule)
        leaving: dict[str, list[Transition]] = {}
        for transition in alive:
            if transition.source in reached and transition.id not in self.unsound:
                leaving.setdefault(transition.source, []).append(transition)
        for state, rivals in leaving.items():
            self.choices(component, state, rivals)
            self.loops(state, rivals)

    def constantly_false(self, component: Component, machine: Machine) -> set[str]:
        dead = set()
        for transition in machine.transitions:
            if transition.guard is None or transition.id in self.unsound:
                continue
            answer = self.ask(component, transition, [transition.guard])
            if answer.holds is False:
                dead.add(transition.id)
                rule = f'a guard must be able to hold, but "{transition.guard}" of {transition.id!r} never does'
                self.warn(transition.line, "dead-transition", rule, "correct the guard, or delete the transition")
            elif answer.holds is None:
                rule = f'could not decide whether "{transition.guard}" of {transition.id!r} can hold'
                self.warn(transition.line, "undecided-guard", rule, "compare each variable with constants only")
        return dead

    def choices(self, component: Component, state: str, rivals: list[Transition]) -> None:
        pairs = [
            (one, two)
            for one, two in islice(combinations(rivals, 2), 100 * MAX_PAIRS)
            if _channel(one) == _channel(two)
        ]
        for one, two in pairs[:MAX_PAIRS]:
            answer = together(self.scopes, component, one, two, self.budget)
            both = f"{one.id!r} and {two.id!r}"
            if answer.holds:
                example = f", for example when {answer}" if answer.values else ""
                rule = f"a state must have one next step, but {both} can both leave {state!r}{example}"
                self.warn(two.line, "nondeterminism", rule, "make the guards exclude each other, if it is not meant")
            elif answer.holds is None:
                rule = f"could not decide whether {both} can both leave {state!r}"
                self.warn(two.line, "undecided-choice", rule, "compare each variable with constants only")
        if len(pairs) > MAX_PAIRS or len(rivals) * (len(rivals) - 1) // 2 > 100 * MAX_PAIRS:
            rule = f"could not compare all pairs of the {len(rivals)} transitions that leave {state!r}"
            self.warn(rivals[0].line, "undecided-choice", rule, "split the state")

    def loops(self, state: str, rivals: list[Transition]) -> None:
        # Beside a spontaneous rival, the choice between the two was reported already.
        if any(not each.is_loop and each.event is None for each in rivals):
            return
        others = [each.id for each in rivals if not each.is_loop]
        for loop in rivals:
            if loop.is_loop and loop.event is None and loop.guard is None and others:
                beside = ", ".join(others)
                rule = f"a loop must end, but {loop.id!r} can repeat in {state!r} without end, beside {beside}"
                self.warn(loop.line, "endless-loop", rule, "give it a guard or an event")

    def ask(self, component: Component, transition: Transition, guards: list[Expression]) -> Answer:
        types = self.scopes.types(component.name, transition)
        question = Question(types, self.scopes.classes, self.scopes.domains(component.name))
        return question.witness(guards, self.budget)


def _channel(transition: Transition) -> str:
    return transition.event.channel if transition.event is not None else ""


def _closure(start: str, edges: Iterable[tuple[str, str]]) -> set[str]:
    following: dict[str, list[str]] = {}
    for source, target in edges:
        following.setdefault(source, []).append(target)
    reached, border = {start}, [start]
    while border:
        for state in following.get(border.pop(), ()):
            if state not in reached:
                reached.add(state)
                border.append(state)
    return reached
