"""Translates texts of guards and actions to expressions and branches of assignments, or refuses them by name.

Arithmetic, comparisons, assignments, choices and the functions both languages share are translated exactly;
where a value depends on a choice, a guard becomes a disjunction and an action becomes several branches. What
could call, loop or reach outside is refused.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from parcours.errors import BadModel
from parcours.model.expression import Assignment, Expression, Literal, Unary
from parcours.model.structure import Variable
from parcours_formats.guard_languages.foreign_syntax import Parser, Set, Statement, When
from parcours_formats.guard_languages.foreign_tokens import ForeignTokens, Language
from parcours_formats.guard_languages.translation import Scope, Translation, refusal, sized
from parcours_formats.guard_languages.values import (
    FALSE,
    KINDS,
    MAX_CASES,
    TRUE,
    conjunction,
    kind_of,
    literal,
    negation,
    replaced,
)

MAX_ACTIONS = 1_000
"""Most assignments of one branch."""


@dataclass(frozen=True, slots=True)
class Branch:
    """What statements do when `guard` holds beforehand: assignments in order."""

    guard: Expression
    actions: tuple[Assignment, ...]

    def before(self, condition: Expression, where: str) -> Expression:
        """Return a condition on the values afterwards in terms of the values before."""
        return condition if condition in (TRUE, FALSE) else replaced(condition, self.held(where))

    def under(self, condition: Expression, where: str) -> Branch | None:
        """Return the branch on which a condition on the values afterwards holds too; None if it cannot."""
        guard = conjunction((self.guard, self.before(condition, where)))
        return None if guard == FALSE else Branch(sized(guard, where), self.actions)

    def held(self, where: str) -> dict[str, Expression]:
        """Return what each assigned variable holds afterwards, in terms of the values before."""
        values: dict[str, Expression] = {}
        for action in self.actions:
            values[action.target] = sized(replaced(action.value, values), where)
        return values

    def then(self, target: str, value: Expression, where: str) -> Branch:
        """Return the branch with one more assignment. Raises BadModel beyond MAX_ACTIONS."""
        if len(self.actions) >= MAX_ACTIONS:
            rule = f"an action is translated to at most {MAX_ACTIONS} assignments, but this one has more"
            raise BadModel(where, rule, "split the action", slug="expression-size")
        return Branch(self.guard, (*self.actions, Assignment(target, value)))


def guard(text: str, language: Language, where: str, kinds: Mapping[str, str] | None = None) -> Expression:
    """Return a condition, e.g. `x === 1 && !done`, as an expression of our language; a number stands for `x != 0`.

    `where` (file, line, element) is for messages, and `kinds` the type (bool, int, real, text) of variables, if known.
    Raises BadModel if the text is no condition (foreign-syntax), or our language cannot say it (foreign-construct).
    """
    return condition(text, Scope(language, kinds or {}), where)


def condition(text: str, scope: Scope, where: str) -> Expression:
    """Return a condition whose names a scope knows, as `guard`."""
    tokens = ForeignTokens(text, scope.language, where)
    tree = Parser(tokens).condition()
    tokens.accept(";")
    if tokens.token.kind != "end":
        tokens.fail("an operator or the end")
    return sized(Translation(scope, where).truth(tree), where)


def branches(text: str, scope: Scope, where: str) -> tuple[Branch, ...]:
    """Return what statements do, one branch for each way their choices can fall; exactly one guard holds."""
    found = performed(Parser(ForeignTokens(text, scope.language, where)).statements(), scope, where)
    for branch in found:
        sized(branch.guard, where)
        for action in branch.actions:
            sized(action.value, where)
    return found


def performed(
    statements: Iterable[Statement], scope: Scope, where: str, before: Branch | None = None
) -> tuple[Branch, ...]:
    """Return the branches of statements that are parsed already, as `branches`, behind those of another branch."""
    now = [before or Branch(TRUE, ())]
    for statement in statements:
        now = [after for before in now for after in _after(before, statement, scope, where)]
        if len(now) > MAX_CASES:
            rule = f"translated statements have at most {MAX_CASES} branches, but these have more"
            raise BadModel(where, rule, "split the action", slug="expression-size")
    return tuple(now)


def _after(before: Branch, statement: Statement, scope: Scope, where: str) -> Iterable[Branch]:
    #   if (c) x = 1 else x = y > 0 ? 2 : 3      is three branches, each with one guard:
    #   c / x := 1      !c && y > 0 / x := 2      !c && !(y > 0) / x := 3
    translation = Translation(scope, where)
    if isinstance(statement, Set):
        for case, place in scope.target(statement.place, where):
            values = translation.of_kind(statement.value, scope.kinds.get(place.id, ""))
            scope.spend(len(values), where)
            for holding, value in values:
                if (after := before.under(conjunction((case, holding)), where)) is not None:
                    yield after.then(place.id, value, where)
        return
    if not isinstance(statement, When):
        raise refusal(where, "a loop or a call")
    holding = translation.truth(statement.condition)
    for choice, body in ((holding, statement.yes), (negation(holding), statement.no)):
        if (start := before.under(choice, where)) is not None:
            now = [start]
            for inner in body:
                now = [after for each in now for after in _after(each, inner, scope, where)]
            yield from now


def variables(initial: Iterable[Assignment], later: Iterable[Assignment], where: str) -> tuple[Variable, ...]:
    """Return the variables that initial assignments of constants declare; one that ever gets a real is a real."""
    values: dict[str, bool | int | float | str] = {}
    for action in initial:
        value = replaced(action.value, {name: literal(value) for name, value in values.items()})
        constant = value.operand if isinstance(value, Unary) else value
        if not isinstance(constant, Literal):
            rule = f'an initial value is a constant, but {action.target!r} starts as "{action.value}"'
            raise BadModel(where, rule, "write the constant", slug="foreign-construct")
        given = constant.value
        values[action.target] = -given if isinstance(value, Unary) and not isinstance(given, str | bool) else given
    kinds = {name: KINDS[type(value)] for name, value in values.items()}
    later = [action for action in later if kinds.get(action.target) == "int"]
    # A real spreads along assignments, perhaps several of them: again until nothing changes.
    before = None
    while before != kinds:
        before = dict(kinds)
        for action in later:
            if kind_of(action.value, kinds) == "real":
                kinds[action.target] = "real"
    return tuple(
        Variable(name, kinds[name], float(value) if kinds[name] == "real" and isinstance(value, int) else value)
        for name, value in values.items()
    )
