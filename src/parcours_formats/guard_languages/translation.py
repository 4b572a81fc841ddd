"""Translates foreign syntax trees to our expressions; a scope says what their names mean."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass, field

from parcours.errors import BadModel
from parcours.model.expression import Apply, Binary, Expression, Literal, Name, Unary
from parcours.model.expression.parsing import MAX_DEPTH, MAX_LENGTH
from parcours.model.nodes import is_identifier
from parcours_formats.guard_languages import foreign_syntax as syntax
from parcours_formats.guard_languages.foreign_tokens import Language
from parcours_formats.guard_languages.values import (
    FALSE,
    MAX_CASES,
    TRUE,
    Cases,
    always,
    conjunction,
    depth,
    disjunction,
    folded,
    holds,
    is_natural,
    joined,
    kind_of,
    literal,
    negation,
)

FUNCTIONS = {
    "javascript": {f"Math.{name}": name for name in ("abs", "floor", "hypot", "max", "min", "sqrt")},
    "uppaal": {
        "fabs": "abs",
        "fmax": "max",
        "fmin": "min",
        **{name: name for name in ("abs", "floor", "hypot", "sqrt")},
    },
}
"""The functions of each language that ours has too."""


@dataclass
class Scope:
    """What the names of a foreign text mean. Readers with arrays, records or parameters override the methods."""

    language: Language
    kinds: Mapping[str, str] = field(default_factory=dict)
    naturals: Set[str] = frozenset()

    def spend(self, count: int, where: str) -> None:
        """Count cases that are written out. Readers that expand ranges bound their sum."""

    def read(self, tree: syntax.Identifier | syntax.Index | syntax.Member, where: str) -> Cases:
        """Return what a place of the foreign model holds."""
        return always(self.target(tree, where)[0][1])

    def target(self, tree: syntax.Tree, where: str) -> list[tuple[Expression, Name]]:
        """Return the variables that an assignment to a place may change, each with the condition for it."""
        if isinstance(tree, syntax.Identifier) and is_identifier(tree.name):
            return [(TRUE, Name(tree.name))]
        raise refusal(where, construct_of(tree))

    def applied(self, tree: syntax.Applied, where: str) -> Cases:
        """Return the value of a function."""
        own = FUNCTIONS[self.language].get(tree.function)
        if own is None:
            raise refusal(where, f"a call of the function {tree.function!r}")
        arguments = [Translation(self, where).number(each) for each in tree.arguments]
        return joined(where, lambda *values: folded(Apply(own, values)), *arguments)

    def quantified(self, tree: syntax.Quantified, where: str) -> Cases:
        """Return the value of forall, exists or sum."""
        raise refusal(where, f"{tree.quantifier!r} over a range")


class Translation:
    """Translates trees of one text."""

    def __init__(self, scope: Scope, where: str) -> None:
        self.scope, self.where = scope, where
        self._known: dict[int, tuple[syntax.Tree, Cases]] = {}

    def truth(self, tree: syntax.Tree) -> Expression:
        """Return the condition that a tree stands for; a number stands for `!= 0`."""
        match tree:
            case syntax.Infix("&&", left, right):
                return conjunction((self.truth(left), self.truth(right)))
            case syntax.Infix("||", left, right):
                return disjunction((self.truth(left), self.truth(right)))
            case syntax.Infix("imply", left, right):
                return disjunction((negation(self.truth(left)), self.truth(right)))
            case syntax.Prefix("!", operand):
                return negation(self.truth(operand))
            case syntax.Choice(condition, yes, no):
                choice = self.truth(condition)
                taken = conjunction((choice, self.truth(yes)))
                return disjunction((taken, conjunction((negation(choice), self.truth(no)))))
            case _:
                return holds([(case, self._true(value)) for case, value in self.value(tree)])

    def number(self, tree: syntax.Tree) -> Cases:
        """Return the number that a tree stands for; a truth value is 1 or 0."""
        found: Cases = []
        for case, value in self.value(tree):
            if kind_of(value, self.scope.kinds) != "bool":
                found.append((case, value))
                continue
            for condition, number in ((value, 1), (negation(value), 0)):
                if (both := conjunction((case, condition))) != FALSE:
                    found.append((both, Literal(number)))
        return found

    def of_kind(self, tree: syntax.Tree, kind: str) -> Cases:
        """Return what a tree stands for as a value of a variable of that kind."""
        if kind == "bool":
            return always(self.truth(tree))
        return self.number(tree) if kind in ("int", "real", "clock") else self.value(tree)

    def value(self, tree: syntax.Tree) -> Cases:
        """Return what a tree stands for, of whatever kind."""
        # Operators ask for their operands as values and as numbers: each is translated once.
        if id(tree) not in self._known:
            self._known[id(tree)] = tree, self._value(tree)
        return self._known[id(tree)][1]

    def _value(self, tree: syntax.Tree) -> Cases:
        match tree:
            case syntax.Constant(constant):
                return always(literal(constant))
            case syntax.Identifier() | syntax.Index() | syntax.Member():
                return self.scope.read(tree, self.where)
            case syntax.Prefix("-", operand):
                return joined(self.where, lambda value: folded(Unary("-", value)), self.number(operand))
            case syntax.Infix("==" | "!=" | "<" | "<=" | ">" | ">=" as operator, left, right):
                return always(self._comparison(operator, left, right))
            case syntax.Infix("+" | "-" | "*" | "/" | "%" | "<?" | ">?" as operator, left, right):
                return self._arithmetic(operator, left, right)
            case syntax.Choice(condition, yes, no):
                choice = self.truth(condition)
                found = [(conjunction((choice, case)), value) for case, value in self.value(yes)]
                found += [(conjunction((negation(choice), case)), value) for case, value in self.value(no)]
                return [(case, value) for case, value in found if case != FALSE]
            case syntax.Applied():
                return self.scope.applied(tree, self.where)
            case syntax.Record() | syntax.Series():
                raise refusal(self.where, construct_of(tree))
            case syntax.Quantified():
                return self.scope.quantified(tree, self.where)
            case syntax.Infix(operator, left, _) if self.scope.language == "javascript":
                kinds = {kind_of(value, self.scope.kinds) for _, value in self.value(left)}
                if kinds & {"int", "real", "text"}:
                    raise refusal(self.where, f"{operator} on values that are not true or false")
        return always(self.truth(tree))

    def _true(self, value: Expression) -> Expression:
        kind = kind_of(value, self.scope.kinds)
        if kind in ("int", "real"):
            return folded(Binary("!=", value, Literal(0)))
        return folded(Binary("!=", value, Literal(""))) if kind == "text" else value

    def _comparison(self, operator: str, left: syntax.Tree, right: syntax.Tree) -> Expression:
        kinds = self.scope.kinds
        sides = [self.value(left), self.value(right)]
        among = {kind_of(value, kinds) == "bool" for side in sides for _, value in side}
        if among == {True, False} or (among == {True} and operator not in ("==", "!=")):
            known = {kind_of(value, kinds) for side in sides for _, value in side}
            if known & {"int", "real"} or operator not in ("==", "!="):
                sides = [self.number(left), self.number(right)]
        if (
            operator in ("==", "!=")
            and isinstance(left, syntax.Infix)
            and left.operator == "%"
            and right == syntax.Constant(0)
        ):
            # Languages differ in the sign of a remainder, not in whether there is one.
            sides[0] = joined(self.where, _binary("%"), self.number(left.left), self.number(left.right))
        return holds(joined(self.where, _binary(operator), *sides))

    def _joined_texts(self, one: Cases, two: Cases) -> Cases:
        """Return texts put together, where each case says which: ours cannot put variables together."""
        found: Cases = []
        for case, (a, b) in _pairs(joined(self.where, lambda a, b: Apply("pair", (a, b)), one, two)):
            if "text" not in (kind_of(a, self.scope.kinds), kind_of(b, self.scope.kinds)):
                raise refusal(self.where, "+ on what is now a text, now a number")
            for first, left in self._spelled(a):
                for second, right in self._spelled(b):
                    if (both := conjunction((case, first, second))) != FALSE:
                        found.append((both, Literal(left + right)))
        if len(found) > MAX_CASES:
            rule = f"a translated value has at most {MAX_CASES} cases, but this one has {len(found)}"
            raise BadModel(self.where, rule, "split the expression", slug="expression-size")
        return found

    def _spelled(self, value: Expression) -> list[tuple[Expression, str]]:
        if (text := spelled(value)) is not None:
            return [(TRUE, text)]
        if kind_of(value, self.scope.kinds) == "bool":
            return [(value, "true"), (negation(value), "false")]
        raise self._varies(f'"{value}"')

    def _varies(self, what: str) -> BadModel:
        rule = f"only constant texts, numbers and truth values are joined by +, but {what} varies"
        remedy = "write the texts it can become as a choice: x == 1 ? 'a1' : 'a2'"
        return BadModel(self.where, rule, remedy, slug="foreign-construct")

    def _arithmetic(self, operator: str, left: syntax.Tree, right: syntax.Tree) -> Cases:
        if operator == "+":
            sides = self.value(left), self.value(right)
            if any(kind_of(value, self.scope.kinds) == "text" for side in sides for _, value in side):
                for tree, side in zip((left, right), sides, strict=True):
                    # What `f && 2` gives is a condition here, but the text would hold a 2.
                    if not is_truth(tree) and any(kind_of(value, self.scope.kinds) == "bool" for _, value in side):
                        raise self._varies("a condition")
                return self._joined_texts(*sides)
        one, two = self.number(left), self.number(right)
        kinds = [kind_of(value, self.scope.kinds) for side in (one, two) for _, value in side]
        if "text" in kinds:
            raise refusal(self.where, f"{operator} on texts")
        if operator in ("<?", ">?"):
            function = "min" if operator == "<?" else "max"
            return joined(self.where, lambda a, b: folded(Apply(function, (a, b))), one, two)
        truncates = operator == "/" and self.scope.language == "uppaal" and "real" not in kinds
        if operator != "%" and not truncates:
            return joined(self.where, _binary(operator), one, two)
        return [
            (conjunction((case, condition)), value)
            for case, (a, b) in _pairs(joined(self.where, lambda a, b: Apply("pair", (a, b)), one, two))
            for condition, value in (self._quotient(a, b) if truncates else self._remainder(a, b))
        ]

    def _quotient(self, a: Expression, b: Expression) -> Cases:
        # Division that drops the fraction, as in C: ours keeps it, and floor drops it for what is not negative.
        whole = folded(Apply("floor", (folded(Binary("/", a, b)),)))
        if self._natural(a) and self._natural(b):
            return always(whole)
        opposite = folded(Unary("-", folded(Apply("floor", (folded(Binary("/", folded(Unary("-", a)), b)),)))))
        product = a if self._natural(b) else folded(Binary("*", a, b))
        return _by_sign(product, whole, opposite)

    def _remainder(self, a: Expression, b: Expression) -> Cases:
        # The sign of the dividend, as in C and JavaScript: ours has that of the divisor.
        divisor = b if self._natural(b) else folded(Apply("abs", (b,)))
        plain = folded(Binary("%", a, divisor))
        if self._natural(a):
            return always(plain)
        return _by_sign(a, plain, folded(Unary("-", folded(Binary("%", folded(Unary("-", a)), divisor)))))

    def _natural(self, node: Expression) -> bool:
        return is_natural(node, self.scope.naturals)


def is_truth(tree: syntax.Tree) -> bool:
    """Return whether the tree shows that a condition is true or false in JavaScript, not merely as good as that."""
    match tree:
        case syntax.Constant() | syntax.Prefix("!", _) | syntax.Infix("==" | "!=" | "<" | "<=" | ">" | ">=", _, _):
            return True
        case syntax.Choice(_, yes, no):
            return is_truth(yes) and is_truth(no)
        case _:
            return False


def spelled(value: Expression) -> str | None:
    """Return how JavaScript writes a constant inside a text; None where it varies, or where we are not sure.

    >>> spelled(Literal("a")), spelled(Literal(2.0)), spelled(Unary("-", Literal(0.5))), spelled(Literal(1e21))
    ('a', '2', '-0.5', None)
    """
    if isinstance(value, Unary) and isinstance(value.operand, Literal) and kind_of(value, {}) in ("int", "real"):
        opposite = spelled(value.operand)
        return opposite if opposite in (None, "0") else f"-{opposite}"
    constant = value.value if isinstance(value, Literal) else None
    if isinstance(constant, str | None):
        return constant
    if isinstance(constant, bool):
        return "true" if constant else "false"
    # Between these, both languages write the shortest decimals that read back, without an exponent.
    is_plain = constant == 0 or 1e-4 <= abs(constant) <= 2**53
    return (str(int(constant)) if constant == int(constant) else repr(constant)) if is_plain else None


def _binary(operator: str) -> Callable[..., Expression]:
    return lambda left, right: folded(Binary(operator, left, right))


def _by_sign(node: Expression, positive: Expression, negative: Expression) -> Cases:
    condition = folded(Binary(">=", node, Literal(0)))
    found = [(condition, positive), (negation(condition), negative)]
    return [(case, value) for case, value in found if case != FALSE]


def _pairs(cases: Cases) -> list[tuple[Expression, tuple[Expression, Expression]]]:
    return [(case, (pair.arguments[0], pair.arguments[1])) for case, pair in cases if isinstance(pair, Apply)]


def sized(node: Expression, where: str) -> Expression:
    """Return the expression if it is no longer than our own parser allows, so that it can be written and read."""
    if depth(node) >= MAX_DEPTH or len(str(node)) > MAX_LENGTH:
        size = f"{MAX_LENGTH} characters and {MAX_DEPTH} levels"
        rule = f"a translated expression has at most {size}, but this one has more"
        raise BadModel(where, rule, "split it", slug="expression-size")
    return node


def refusal(where: str, what: str) -> BadModel:
    """Return the refusal of something that our language cannot say."""
    rule = f"only arithmetic, comparisons, assignments and choices are translated, but here is {what}"
    return BadModel(where, rule, "write it with these", slug="foreign-construct")


def construct_of(tree: syntax.Tree) -> str:
    """Return what a place is that our language does not know, in words."""
    match tree:
        case syntax.Identifier(name):
            return f"the name {name!r}"
        case syntax.Member(_, name):
            return f"a field {name!r} of an object"
        case syntax.Index():
            return "an element of a list"
        case syntax.Applied(function, _):
            return f"a call of the function {function!r}"
        case syntax.Record():
            return "an object"
        case syntax.Series():
            return "a list"
        case _:
            return "an assignment to a value"
