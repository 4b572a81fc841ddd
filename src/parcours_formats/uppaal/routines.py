"""Functions of a UPPAAL file written out where they are called: branches of assignments, and values.

Variables of a function are worked out of the result: only those of the system remain.
"""

from __future__ import annotations

from collections.abc import Iterable

from parcours.model.expression import Assignment, Expression, names
from parcours_formats.guard_languages import Branch, Tokens, refusal, sized
from parcours_formats.guard_languages.tree import Applied
from parcours_formats.guard_languages.values import (
    TRUE,
    Cases,
    replaced,
)
from parcours_formats.uppaal.bodies import BodyParser
from parcours_formats.uppaal.declared import Routine
from parcours_formats.uppaal.environment import Environment
from parcours_formats.uppaal.execution import Execution, Running, is_local


def updates(text: str, environment: Environment, origin: str, line: int) -> list[Branch]:
    """Return what an update label does, one branch for each way its choices can fall.

    Args:
        text: assignments and calls, e.g. `x = 0, enqueue(e)`.
        environment: the names it sees.
        origin: the file's name, for messages.
        line: where the text starts.

    Raises:
        BadModel: the text cannot be translated.
    """
    where = f"{origin}:{line}"
    statements = BodyParser(Tokens(text, "uppaal", origin, line)).statements()
    found = Execution(environment, where).run(statements, [Running(Branch(TRUE, ()))])
    environment.cells.known = {}
    return [Branch(sized(each.branch.guard, where), without_locals(each.branch.actions, where)) for each in found]


def value_of(call: Applied, environment: Environment, routine: Routine, where: str) -> Cases:
    """Return the value of a call, in terms of the variables before it.

    Raises:
        BadModel: the function changes variables that outlive it, returns nothing, or cannot be translated.
    """
    found: Cases = []
    kept = environment.cells.known
    for each in Execution(environment, where).called(call, routine, Running(Branch(TRUE, ()))):
        if any(not is_local(action.target) for action in each.branch.actions):
            raise refusal(where, f"the function {call.function!r}, which changes variables, inside a value")
        if each.value is None:
            raise refusal(where, f"the value of {call.function!r}, which returns none")
        found.append((each.branch.guard, replaced(each.value, each.branch.held(where))))
    environment.cells.known = kept
    return found


def without_locals(actions: Iterable[Assignment], where: str) -> tuple[Assignment, ...]:
    """Return assignments with the variables of functions replaced by what they hold.

    Raises:
        BadModel: one is read after what it was computed from has changed.
    """
    held: dict[str, Expression] = {}
    stale: set[str] = set()
    kept = []
    for action in actions:
        if used := sorted(stale & names(action.value)):
            raise refusal(where, f"the local variable {used[0].partition(chr(39))[0]!r}, read after its source changed")
        value = replaced(action.value, held)
        if is_local(action.target):
            held[action.target] = value
            stale.discard(action.target)
        else:
            kept.append(Assignment(action.target, sized(value, where)))
            stale |= {local for local, known in held.items() if action.target in names(known)}
    return tuple(kept)


class CallingEnvironment(Environment):
    """The names of one scope, functions among them."""

    def applied(self, tree: Applied, where: str) -> Cases:
        """Return the value of a call: of a function of the file, or of the language."""
        if self.knows(tree.function):
            routine = self.find(tree.function, where)
            if isinstance(routine, Routine):
                return value_of(tree, self, routine, where)
        return super().applied(tree, where)
