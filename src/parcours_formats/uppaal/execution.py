"""Follows statements of UPPAAL's C, with loops and calls, along every way their choices can fall.

Nothing runs: what is assigned stays an expression of the values before, and a way whose conditions exclude each other
ends there. What does not come to an end in bounds is refused.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from parcours.errors import BadModel
from parcours.model.expression import Apply, Assignment, Expression, names
from parcours_formats.guard_languages import Branch, ForeignTokens, Translation, performed, refusal, sized, values
from parcours_formats.guard_languages.foreign_syntax import Set, Statement, When
from parcours_formats.guard_languages.values import TRUE, Cases, always, is_constant, literal, negation, replaced
from parcours_formats.uppaal.declarations import BodyParser, Declared, Iteration, Local, Loop, Perform, Return, Routine
from parcours_formats.uppaal.environment import Environment
from parcours_formats.uppaal.symbols import UppaalVariable

MAX_TURNS = 200
"""Most turns of one loop."""

MAX_NESTED = 8
"""Most calls inside each other."""


@dataclass(frozen=True, slots=True)
class Running:
    """Where a body stands on one way: what was done, and the value it returned, if it did."""

    branch: Branch
    has_returned: bool = False
    value: Expression | None = None


class SymbolicExecution:
    """Follows statements along every way."""

    def __init__(self, scope: Environment, where: str) -> None:
        self.scope, self.where = scope, where

    def run(self, statements: Iterable[Statement], now: list[Running]) -> list[Running]:
        """Return where the ways end; those that have returned stay as they are."""
        for statement in statements:
            self.scope.cells.spend(self.where, len(now))
            if isinstance(statement, Local):
                now = self.declared(statement.declared, now)
            else:
                ends = ([each] if each.has_returned else self.after(statement, each) for each in now)
                now = [after for end in ends for after in end]
            self.bounded(now)
        return now

    def within(self) -> SymbolicExecution:
        """Return the execution of a block inside: what it declares is not seen outside."""
        return SymbolicExecution(self.scope.inner(), self.where)

    def bounded(self, now: list[Running]) -> None:
        """Raise BadModel if there are too many ways."""
        if len(now) > values.MAX_CASES:
            rule = f"an update has at most {values.MAX_CASES} branches, but this one has more"
            raise BadModel(self.where, rule, "make its arrays or ranges smaller", slug="expansion-size")

    def after(self, statement: Statement, here: Running) -> list[Running]:
        """Return where one statement leads."""
        self.recall(here)
        match statement:
            case Set():
                found = performed([statement], self.scope, self.where, here.branch)
                return [Running(branch) for branch in found]
            case When(condition, yes, no):
                choice = Translation(self.scope, self.where).truth(condition)
                taken = self.within().run(yes, self.under(choice, here))
                return [*taken, *self.within().run(no, self.under(negation(choice), here))]
            case Perform(call):
                routine = self.scope.find(call.function, self.where)
                if not isinstance(routine, Routine):
                    raise refusal(self.where, f"a call of {call.function!r}")
                return [Running(each.branch) for each in self.called(call, routine, here)]
            case Loop():
                return self.turns(statement, here)
            case Iteration(name, type_, body):
                now, turns = [here], tuple(self.scope.shape(type_, self.where).values(self.where))
                self.scope.cells.spend(self.where, len(turns))
                for value in turns:
                    block = self.within()
                    block.scope.hold(name, value)
                    now = block.run(body, now)
                return now
            case Return(value):
                if value is None:
                    return [replace(here, has_returned=True)]
                cases = Translation(self.scope, self.where).value(value)
                return [Running(each.branch, True, result) for case, result in cases for each in self.under(case, here)]
            case _:
                raise refusal(self.where, f"a statement {type(statement).__name__!r}")

    def recall(self, here: Running) -> None:
        """Let variables of functions whose values are known on this way mean these, so that indices are constant."""
        known: dict[str, Expression] = {}
        for action in here.branch.actions:
            if is_local(action.target):
                known.pop(action.target, None)
                value = replaced(action.value, known)
                if is_constant(value):
                    known[action.target] = value
        self.scope.cells.known = known

    def under(self, condition: Expression, here: Running) -> list[Running]:
        """Return the way with one more condition on the values now; none if that cannot hold."""
        branch = here.branch.under(condition, self.where)
        return [] if branch is None else [replace(here, branch=branch)]

    def turns(self, loop: Loop, here: Running) -> list[Running]:
        """Return the ways out of a loop."""
        now, done = [here], list[Running]()
        for _ in range(MAX_TURNS):
            self.scope.cells.spend(self.where, len(now))
            # Each way leaves the loop where its condition fails, and takes one more turn where it holds.
            inside: list[Running] = []
            for each in now:
                self.recall(each)
                holds = Translation(self.scope, self.where).truth(loop.condition)
                done += self.under(negation(holds), each)
                inside += self.under(holds, each)
            now = self.within().run(loop.body, inside)
            done += [each for each in now if each.has_returned]
            now = [each for each in now if not each.has_returned]
            self.bounded([*now, *done])
            if not now:
                return done
        raise BadModel(self.where, f"a loop ends within {MAX_TURNS} turns, but this one may not", slug="expansion-size")

    def declared(self, declared: Declared, now: list[Running]) -> list[Running]:
        """Return where the declaration of a variable leads: from now on its name means a new cell."""
        self.scope.cells.known = {}  # this holds on several ways
        shape = self.scope.shape(declared.type, self.where, declared.lengths)
        made, cells = self.scope.cells.make_local(declared.name, shape, declared.line, self.where)
        if (
            isinstance(made, UppaalVariable)
            and declared.initial is not None
            and not isinstance(declared.initial, tuple)
        ):
            cases = Translation(self.scope, self.where).of_kind(declared.initial, made.kind)
            now = [after for each in now for after in self.assigned(made.id, cases, each)]
        elif declared.initial is not None and cells:
            raise refusal(self.where, f"initial values of the local variable {declared.name!r}")
        else:
            for cell in cells:
                now = [after for each in now for after in self.assigned(cell.id, always(literal(cell.initial)), each)]
        self.scope.names[declared.name] = made
        return now

    def assigned(self, id: str, cases: Cases, here: Running) -> list[Running]:
        """Return the ways on which a variable is assigned one of several values."""
        return [
            replace(each, branch=each.branch.then(id, value, self.where))
            for case, value in cases
            for each in self.under(case, here)
        ]

    def called(self, call: Apply, routine: Routine, here: Running) -> list[Running]:
        """Return the ways out of a call, with what they return."""
        if self.scope.cells.depth >= MAX_NESTED:
            raise refusal(self.where, f"calls more than {MAX_NESTED} deep")
        if len(call.arguments) != len(routine.parameters):
            count, given = len(routine.parameters), len(call.arguments)
            rule = f"{call.function!r} has {count} parameters, but gets {given} arguments"
            raise BadModel(self.where, rule, slug="arity")
        inner = self.scope.home(routine).inner()
        now = [here]
        for parameter, argument in zip(routine.parameters, call.arguments, strict=True):
            shape = inner.shape(parameter.type, self.where, parameter.lengths)
            if parameter.is_reference or shape.lengths or shape.kind == "struct":
                inner.names[parameter.name] = self.scope.place(argument, self.where)
            else:
                made, cells = self.scope.cells.make_local(parameter.name, shape, parameter.line, self.where)
                inner.names[parameter.name] = made
                cases = Translation(self.scope, self.where).of_kind(argument, shape.kind)
                now = [after for each in now for after in self.assigned(cells[0].id, cases, each)]
        tokens = routine.tokens
        tokens.position = routine.body + 1
        self.scope.cells.depth += 1
        found = SymbolicExecution(inner, self.where).run(BodyParser(tokens).statements("}"), now)
        self.scope.cells.depth -= 1
        return found


def is_local(id: str) -> bool:
    """Return whether a variable belongs to one call of a function."""
    return "'" in id


def updates(text: str, environment: Environment, origin: str, line: int) -> list[Branch]:
    """Return what an update label does, one branch for each way its choices can fall."""
    where = f"{origin}:{line}"
    statements = BodyParser(ForeignTokens(text, "uppaal", origin, line)).statements()
    found = SymbolicExecution(environment, where).run(statements, [Running(Branch(TRUE, ()))])
    environment.cells.known = {}
    return [Branch(sized(each.branch.guard, where), without_locals(each.branch.actions, where)) for each in found]


def value_of(call: Apply, environment: Environment, routine: Routine, where: str) -> Cases:
    """Return the value of a call, in terms of the variables before it."""
    found: Cases = []
    kept = environment.cells.known
    for each in SymbolicExecution(environment, where).called(call, routine, Running(Branch(TRUE, ()))):
        if any(not is_local(action.target) for action in each.branch.actions):
            raise refusal(where, f"the function {call.function!r}, which changes variables, inside a value")
        if each.value is None:
            raise refusal(where, f"the value of {call.function!r}, which returns none")
        found.append((each.branch.guard, replaced(each.value, each.branch.held(where))))
    environment.cells.known = kept
    return found


def without_locals(actions: Iterable[Assignment], where: str) -> tuple[Assignment, ...]:
    """Return assignments with the variables of functions replaced by what they hold."""
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

    def applied(self, tree: Apply, where: str) -> Cases:
        """Return the value of a call: of a function of the file, or of the language."""
        if isinstance(routine := self.names.get(tree.function), Routine):
            return value_of(tree, self, routine, where)
        return super().applied(tree, where)
