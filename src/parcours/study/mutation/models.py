"""The mutants of a model: if it said something else, would the judges find clean runs at fault?

A judge that lets every clean run pass under a wrong guard does not look at that guard, and would not notice a component
that has it wrong either.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

from parcours.model.expression import Assignment, Expression
from parcours.model.expression.syntax import Binary, Literal, Unary, substitute, walk
from parcours.model.structure import Cefsm, Component, Machine, Transition
from parcours.model.writing import write_model
from parcours.study.mutation.mutant import Mutant, diff_of

_RELATIONS = {"<": ("<=", ">"), "<=": ("<", ">="), ">": (">=", "<"), ">=": (">", "<="), "==": ("!=",), "!=": ("==",),
              "&&": ("||",), "||": ("&&",)}  # fmt: skip

Changed = tuple[str, str, Transition]  # operator, what became of what, the transition as it is then


def model_mutants(model: Cefsm) -> list[tuple[Mutant, Cefsm]]:
    """Return the mutants of a model's transitions, each with the model that it is."""
    text = write_model(model)
    found = []
    counts: Counter[tuple[str, str]] = Counter()
    for component in model.components:
        for machine in component.machines:
            for transition in machine.transitions:
                for operator, change, other in _changes(model, component, machine, transition):
                    mutated = _with(model, component, machine, transition, other)
                    counts[transition.id, operator] += 1
                    id = f"{component.name}:{transition.id}:{counts[transition.id, operator]}:{operator}"
                    diff = diff_of("model.yaml", text, write_model(mutated))
                    found.append((Mutant(id, operator, model.source, transition.line, change, diff), mutated))
    return found


def _changes(model: Cefsm, component: Component, machine: Machine, one: Transition) -> Iterator[Changed]:
    if one.guard is not None:
        for guard in _guards(one.guard):
            yield "guard", f"[{one.guard}] -> [{guard}]", replace(one, guard=guard)
        yield "guard", f"[{one.guard}] dropped", replace(one, guard=None)
    others = [state for state in machine.states if state != one.target]
    if others:
        target = others[(machine.states.index(one.target)) % len(others)]
        yield "target", f"to {one.target} -> to {target}", replace(one, target=target)
    for k, action in enumerate(one.actions):
        rest = one.actions[:k], one.actions[k + 1 :]
        yield "action", f"{action} dropped", replace(one, actions=(*rest[0], *rest[1]))
        value = _other(component, action) if isinstance(action, Assignment) else None
        if isinstance(action, Assignment) and value is not None:
            changed = replace(action, value=value)
            yield "action", f"{action} -> {changed}", replace(one, actions=(*rest[0], changed, *rest[1]))
    for k, send in enumerate(one.sends):
        before, after = one.sends[:k], one.sends[k + 1 :]
        yield "message", f"{send.channel} dropped", replace(one, sends=(*before, *after))
        kind = model.channel(send.channel).message
        for channel in model.channels:
            if channel.sender == component.name and channel.name != send.channel and channel.message == kind:
                renamed = replace(send, channel=channel.name)
                change = f"{send.channel} -> {channel.name}"
                yield "message", change, replace(one, sends=(*before, renamed, *after))


def _guards(guard: Expression) -> Iterator[Expression]:
    """Yield the negated guard, and those with one relation, connective or number changed."""
    yield guard.operand if isinstance(guard, Unary) and guard.operator == "!" else Unary("!", guard)
    for part in walk(guard):
        if isinstance(part, Binary):
            for operator in _RELATIONS.get(part.operator, ()):
                if part is guard and len(_RELATIONS[operator]) == 1 and operator in ("==", "!="):
                    continue  # the negated guard
                yield _put(guard, part, Binary(operator, part.left, part.right))
        elif isinstance(part, Literal) and isinstance(part.value, int | float) and not isinstance(part.value, bool):
            for operator in ("+", "-"):
                yield _put(guard, part, Binary(operator, part, Literal(1)))


def _put(root: Expression, part: Expression, instead: Expression) -> Expression:
    return substitute(root, lambda node: instead if node is part else None)


def _other(component: Component, action: Assignment) -> Expression | None:
    """Return another value for an assignment; None if none can be made of it."""
    kind = next((one.type for one in component.variables if one.name == action.target), "")
    if kind == "bool":
        return Unary("!", action.value)
    return Binary("+", action.value, Literal(1)) if kind in ("int", "real") else None


def _with(model: Cefsm, component: Component, machine: Machine, old: Transition, new: Transition) -> Cefsm:
    transitions = tuple(new if one is old else one for one in machine.transitions)
    machines = tuple(replace(one, transitions=transitions) if one is machine else one for one in component.machines)
    parts = tuple(replace(one, machines=machines) if one is component else one for one in model.components)
    return replace(model, components=parts)
