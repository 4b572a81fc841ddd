"""Takes a Cefsm apart into GraphWalker's models: one for each machine, with guards and actions in JavaScript."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import count

from parcours.model.conversion import Loss
from parcours.model.expression import Binary, Expression, Literal, Name
from parcours.model.expression.syntax import walk
from parcours.model.structure import BASE_TYPES, CLOCK, Cefsm, Component, Machine, Transition
from parcours_formats.graphwalker.labels import LabelledEdge, Model, Vertex
from parcours_formats.guard_languages.javascript import WORDS, JavaScriptWriter, javascript
from parcours_formats.guard_languages.values import literal
from parcours_formats.losses import unsaid
from parcours_formats.naming import UniqueNames, joint_name

GENERATOR = "random(edge_coverage(100))"
"""How GraphWalker walks: each of its models needs a generator."""

_HOLDS = frozenset(("actions", "guards", "ids", "states", "variables", "weights"))
_SAYABLE = re.compile(r"[A-Za-z0-9_$.]+")
_OWN_WORDS = frozenset(("start", "blocked", "shared", "init", "reqtag", "weight", "dependency"))
_ESCAPED = "\n\t\r\\'"


def parted(cefsm: Cefsm, *, tags: bool = False) -> tuple[list[Model], tuple[Loss, ...]]:
    """Return the machines of a model as GraphWalker's models, and what these do not hold; `tags` says whether those do.

    Variables of a component with one machine are those of the model; of one with several, they stand in `global`.
    """
    parter = _Parter(cefsm)
    models = [parter.model(component, machine) for component in cefsm.components for machine in component.machines]
    return models, (*unsaid(cefsm, _HOLDS | {"tags"} if tags else _HOLDS), *parter.losses)


class _Parter(JavaScriptWriter):
    def __init__(self, cefsm: Cefsm) -> None:
        super().__init__()
        self.shared, self.edges = UniqueNames(WORDS), UniqueNames()
        self.numbers = {"n": count(), "e": count()}
        self.spoken = {component.name: self.variables(component) for component in cefsm.components}

    def variables(self, component: Component) -> dict[str, Expression]:
        """Return how each variable of the component is called; those that are not said are missing."""
        own = self.shared if len(component.machines) > 1 else UniqueNames(WORDS)
        prefix = "global." if len(component.machines) > 1 else ""
        spoken: dict[str, Expression] = {}
        for variable in component.variables:
            where = f"variable '{component.name}.{variable.name}'"
            if variable.type not in BASE_TYPES:
                if variable.type != CLOCK:
                    self.lose(where, variable.line, "messages are not written")
                continue
            name = own.identifier(variable.name)
            if name != variable.name:
                self.lose(where, variable.line, f"it is called {name!r}")
            if variable.role == "input":
                self.lose(where, variable.line, "there are no inputs: the test must set it before a guard reads it")
            if variable.type == "text" and not _is_plain(str(variable.initial or "")):
                self.lose(where, variable.line, "its initial text has signs that are not written; it is left out")
                continue
            spoken[variable.name] = Name(prefix + name)
        return spoken

    def model(self, component: Component, machine: Machine) -> Model:
        """Return the model of a machine."""
        alone = len(component.machines) == 1
        named = UniqueNames()
        at = {state: f"n{next(self.numbers['n'])}" for state in machine.states}
        vertices = []
        for state in machine.states:
            name = self.renamed(f"state {state!r}", machine.line, state, named)
            tags = tuple(tag for owner, tag in machine.tags if owner == state)
            vertices.append(Vertex(at[state], name, requirements=tags, line=machine.line))
        total = dict.fromkeys(machine.states, 0.0)
        uneven = {each.source for each in machine.transitions if each.weight != 1}
        for transition in machine.transitions:
            total[transition.source] += transition.weight
        edges = []
        for transition in machine.transitions:
            edge = self.edge(component, transition, at)
            if transition.source in uneven and total[transition.source] > 0:
                edge.weight = transition.weight / total[transition.source]
            edges.append(edge)
        actions = tuple(self.initial(component)) if machine is component.machines[0] else ()
        name = joint_name(component.name, machine.name, alone=alone)
        return Model(name, vertices, edges, at[machine.initial], actions, (), GENERATOR, (), machine.line)

    def edge(self, component: Component, transition: Transition, at: Mapping[str, str]) -> LabelledEdge:
        where = f"transition {transition.id!r}"
        name = self.renamed(where, transition.line, transition.id, self.edges)
        parts = [(part, javascript(part)) for part in self.conditions(component, transition)]
        ors = (isinstance(part, Binary) and part.operator == "||" for part, _ in parts)
        guard = " && ".join(f"({text})" if is_or else text for is_or, (_, text) in zip(ors, parts, strict=True))
        assigned = self.assignments(component, transition, "the")
        actions = tuple(f"{target} = {javascript(value)};" for target, value in assigned)
        source, target = at[transition.source], at[transition.target]
        return LabelledEdge(
            f"e{next(self.numbers['e'])}", name, source, target, guard, actions, transition.tags, line=transition.line
        )

    def renamed(self, where: str, line: int, name: str, among: UniqueNames) -> str:
        wanted = name
        if not _SAYABLE.fullmatch(name) or name[0] in "0123456789." or name.lower() in _OWN_WORDS:
            wanted = "_" + re.sub(r"[^A-Za-z0-9_$.]+", "_", name).strip("_")
        given = among.label(wanted)
        if given != name:
            self.lose(where, line, f"names there have no blanks and signs; it is called {given!r}")
        return given

    def initial(self, component: Component) -> Iterator[str]:
        for variable in component.variables:
            name = self.spoken[component.name].get(variable.name)
            if name is not None and variable.role == "local":
                yield f"{name} = {javascript(literal(variable.initial))};"

    def is_said(self, node: Expression, spoken: Mapping[str, Expression]) -> bool:
        """Return whether an expression has a counterpart that labels hold."""
        texts = (part.value for part in walk(node) if isinstance(part, Literal) and isinstance(part.value, str))
        return super().is_said(node, spoken) and all(map(_is_plain, texts))


def _is_plain(text: str) -> bool:
    return all(sign in _ESCAPED or sign.isprintable() for sign in text)
