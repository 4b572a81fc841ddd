"""Translates foreign syntax trees to our expressions; a scope says what their names mean."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, field
from functools import partial

from parcours.errors import BadModel
from parcours.model.expression import Apply, Binary, Expression, FieldAccess, Literal, Name, Unary
from parcours.model.expression.parsing import MAX_DEPTH, MAX_LENGTH
from parcours.model.nodes import is_identifier
from parcours_formats.guard_languages import values
from parcours_formats.guard_languages.foreign_tokens import Language
from parcours_formats.guard_languages.values import FALSE, TRUE, Cases, always, conjunction, folded, kind_of, negation

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

_COMPARING = ("==", "!=", "<", "<=", ">", ">=")


@dataclass
class Scope:
    """What the names of a foreign text mean. Readers with arrays, records or parameters override the methods."""

    language: Language
    kinds: Mapping[str, str] = field(default_factory=dict)
    naturals: Set[str] = frozenset()

    def spend(self, count: int, where: str) -> None:
        """Count cases that are written out. Readers that expand ranges bound their sum."""

    def read(self, tree: Expression, where: str) -> Cases:
        """Return what a place of the foreign model (a name, a field, an element) holds."""
        return always(self.target(tree, where)[0][1])

    def target(self, tree: Expression, where: str) -> list[tuple[Expression, Name]]:
        """Return the variables that an assignment to a place may change, each with the condition for it."""
        if isinstance(tree, Name) and is_identifier(tree.id):
            return [(TRUE, tree)]
        raise refusal(where, construct_of(tree))

    def applied(self, tree: Apply, where: str) -> Cases:
        """Return the value of a function."""
        own = FUNCTIONS[self.language].get(tree.function)
        if own is None:
            raise refusal(where, f"a call of the function {tree.function!r}")
        arguments = [Translation(self, where).number(each) for each in tree.arguments]
        return values.joined(where, lambda *given: folded(Apply(own, given)), *arguments)

    def quantified(self, tree: Apply, where: str) -> Cases:
        """Return the value of forall, exists or sum."""
        raise refusal(where, f"{tree.function[:-1]!r} over a range")


class Translation:
    """Translates trees of one text."""

    def __init__(self, scope: Scope, where: str) -> None:
        self.scope, self.where = scope, where
        self._known: dict[int, tuple[Expression, Cases]] = {}

    def truth(self, tree: Expression) -> Expression:
        """Return the condition that a tree stands for; a number stands for `!= 0`."""
        match tree:
            case Binary("&&", left, right):
                return conjunction((self.truth(left), self.truth(right)))
            case Binary("||", left, right):
                return values.disjunction((self.truth(left), self.truth(right)))
            case Binary("imply", left, right):
                return values.disjunction((negation(self.truth(left)), self.truth(right)))
            case Unary("!", operand):
                return negation(self.truth(operand))
            case Apply("?:", (condition, yes, no)):
                choice = self.truth(condition)
                taken = conjunction((choice, self.truth(yes)))
                return values.disjunction((taken, conjunction((negation(choice), self.truth(no)))))
            case _:
                return values.holds([(case, self._true(value)) for case, value in self.value(tree)])

    def number(self, tree: Expression) -> Cases:
        """Return the number that a tree stands for; a truth value is 1 or 0."""
        found: Cases = []
        for case, value in self.value(tree):
            if self._kind(value) != "bool":
                found.append((case, value))
                continue
            for condition, number in ((value, 1), (negation(value), 0)):
                if (both := conjunction((case, condition))) != FALSE:
                    found.append((both, Literal(number)))
        return found

    def of_kind(self, tree: Expression, kind: str) -> Cases:
        """Return what a tree stands for as a value of a variable of that kind."""
        if kind == "bool":
            return always(self.truth(tree))
        return self.number(tree) if kind in ("int", "real", "clock") else self.value(tree)

    def value(self, tree: Expression) -> Cases:
        """Return what a tree stands for, of whatever kind."""
        # Operators ask for their operands as values and as numbers: each is translated once.
        if id(tree) not in self._known:
            self._known[id(tree)] = tree, self._value(tree)
        return self._known[id(tree)][1]

    def _value(self, tree: Expression) -> Cases:
        match tree:
            case Literal(constant):
                return always(values.literal(constant))
            case Name() | FieldAccess() | Apply("[]", _):
                return self.scope.read(tree, self.where)
            case Unary("-", operand):
                return values.joined(self.where, lambda value: folded(Unary("-", value)), self.number(operand))
            case Binary(operator, left, right) if operator in _COMPARING:
                return always(self._comparison(operator, left, right))
            case Binary("+" | "-" | "*" | "/" | "%" | "<?" | ">?" as operator, left, right):
                return self._arithmetic(operator, left, right)
            case Apply("?:", (condition, yes, no)):
                choice = self.truth(condition)
                found = [(conjunction((choice, case)), value) for case, value in self.value(yes)]
                found += [(conjunction((negation(choice), case)), value) for case, value in self.value(no)]
                return [(case, value) for case, value in found if case != FALSE]
            case Apply("{}" | "[,]", _):
                raise refusal(self.where, construct_of(tree))
            case Apply("forall:" | "exists:" | "sum:", _):
                return self.scope.quantified(tree, self.where)
            case Apply():
                return self.scope.applied(tree, self.where)
            case Binary(operator, left, _) if self.scope.language == "javascript":
                # There, `a && b` is one of its operands, and only that of truth values is a truth value.
                kinds = {self._kind(value) for _, value in self.value(left)}
                if kinds & {"int", "real", "text"}:
                    raise refusal(self.where, f"{operator} on values that are not true or false")
        return always(self.truth(tree))

    def _kind(self, value: Expression) -> str:
        return kind_of(value, self.scope.kinds)

    def _true(self, value: Expression) -> Expression:
        kind = self._kind(value)
        if kind in ("int", "real"):
            return folded(Binary("!=", value, Literal(0)))
        return folded(Binary("!=", value, Literal(""))) if kind == "text" else value

    def _comparison(self, operator: str, left: Expression, right: Expression) -> Expression:
        sides = [self.value(left), self.value(right)]
        known = {self._kind(value) for side in sides for _, value in side}
        if "bool" in known and (operator not in ("==", "!=") or known & {"int", "real"}):
            sides = [self.number(left), self.number(right)]
        match operator, left, right:
            case "==" | "!=", Binary("%", one, two), Literal(0):
                # Languages differ in the sign of a remainder, not in whether there is one.
                sides[0] = values.joined(self.where, partial(_folded, "%"), self.number(one), self.number(two))
        return values.holds(values.joined(self.where, partial(_folded, operator), *sides))

    def _joined_texts(self, one: Cases, two: Cases) -> Cases:
        """Return texts put together, where each case says which: ours cannot put variables together."""
        found: Cases = []
        for case, (a, b) in values.joined(self.where, _pair, one, two):
            if "text" not in (self._kind(a), self._kind(b)):
                raise refusal(self.where, "+ on what is now a text, now a number")
            for first, left in self._spelled(a):
                for second, right in self._spelled(b):
                    if (both := conjunction((case, first, second))) != FALSE:
                        found.append((both, Literal(left + right)))
        values.bounded(len(found), self.where)
        return found

    def _spelled(self, value: Expression) -> list[tuple[Expression, str]]:
        if (text := spelled(value)) is not None:
            return [(TRUE, text)]
        if self._kind(value) == "bool":
            return [(value, "true"), (negation(value), "false")]
        raise self._varies(f'"{value}"')

    def _varies(self, what: str) -> BadModel:
        rule = f"only constant texts, numbers and truth values are joined by +, but {what} varies"
        remedy = "write the texts it can become as a choice: x == 1 ? 'a1' : 'a2'"
        return BadModel(self.where, rule, remedy, slug="foreign-construct")

    def _arithmetic(self, operator: str, left: Expression, right: Expression) -> Cases:
        if operator == "+":
            sides = [(tree, self.value(tree)) for tree in (left, right)]
            if any(self._kind(value) == "text" for _, side in sides for _, value in side):
                for tree, side in sides:
                    # What `f && 2` gives is a condition here, but the text would hold a 2.
                    if not is_truth(tree) and any(self._kind(value) == "bool" for _, value in side):
                        raise self._varies("a condition")
                return self._joined_texts(sides[0][1], sides[1][1])
        one, two = self.number(left), self.number(right)
        kinds = [self._kind(value) for side in (one, two) for _, value in side]
        if "text" in kinds:
            raise refusal(self.where, f"{operator} on texts")
        if operator in ("<?", ">?"):
            function = "min" if operator == "<?" else "max"
            return values.joined(self.where, lambda a, b: folded(Apply(function, (a, b))), one, two)
        truncates = operator == "/" and self.scope.language == "uppaal" and "real" not in kinds
        if operator != "%" and not truncates:
            return values.joined(self.where, partial(_folded, operator), one, two)
        return [
            (conjunction((case, condition)), value)
            for case, (a, b) in values.joined(self.where, _pair, one, two)
            for condition, value in (self._quotient(a, b) if truncates else self._remainder(a, b))
        ]

    def _quotient(self, a: Expression, b: Expression) -> Cases:
        # Division that drops the fraction, as in C: ours keeps it, and floor drops it for what is not negative.
        #   a / b  =   floor(a / b)     where a * b >= 0
        #   a / b  =  -floor(-a / b)    elsewhere
        whole = folded(Apply("floor", (_folded("/", a, b),)))
        if self._natural(a) and self._natural(b):
            return always(whole)
        opposite = folded(Unary("-", folded(Apply("floor", (_folded("/", folded(Unary("-", a)), b),)))))
        return _by_sign(a if self._natural(b) else _folded("*", a, b), whole, opposite)

    def _remainder(self, a: Expression, b: Expression) -> Cases:
        # The sign of the dividend, as in C and JavaScript: ours has that of the divisor.
        divisor = b if self._natural(b) else folded(Apply("abs", (b,)))
        plain = _folded("%", a, divisor)
        if self._natural(a):
            return always(plain)
        return _by_sign(a, plain, folded(Unary("-", _folded("%", folded(Unary("-", a)), divisor))))

    def _natural(self, node: Expression) -> bool:
        return values.is_natural(node, self.scope.naturals)


def is_truth(tree: Expression) -> bool:
    """Return whether the tree shows that a condition is true or false in JavaScript, not merely as good as that."""
    match tree:
        case Literal() | Unary("!", _):
            return True
        case Binary(operator, _, _):
            return operator in _COMPARING
        case Apply("?:", (_, yes, no)):
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


def _folded(operator: str, left: Expression, right: Expression) -> Expression:
    return folded(Binary(operator, left, right))


def _pair(left: Expression, right: Expression) -> tuple[Expression, Expression]:
    return left, right


def _by_sign(node: Expression, positive: Expression, negative: Expression) -> Cases:
    condition = _folded(">=", node, Literal(0))
    found = [(condition, positive), (negation(condition), negative)]
    return [(case, value) for case, value in found if case != FALSE]


def sized(node: Expression, where: str) -> Expression:
    """Return the expression if it is no longer than our own parser allows, so that it can be written and read."""
    if values.depth(node) >= MAX_DEPTH or len(str(node)) > MAX_LENGTH:
        size = f"{MAX_LENGTH} characters and {MAX_DEPTH} levels"
        rule = f"a translated expression has at most {size}, but this one has more"
        raise BadModel(where, rule, "split it", slug="expression-size")
    return node


def refusal(where: str, what: str) -> BadModel:
    """Return the refusal of something that our language cannot say."""
    rule = f"only arithmetic, comparisons, assignments and choices are translated, but here is {what}"
    return BadModel(where, rule, "write it with these", slug="foreign-construct")


def construct_of(tree: Expression) -> str:
    """Return what a place is that our language does not know, in words."""
    match tree:
        case Name(name):
            return f"the name {name!r}"
        case FieldAccess(_, name):
            return f"a field {name!r} of an object"
        case Apply("[]", _):
            return "an element of a list"
        case Apply("{}", _):
            return "an object"
        case Apply("[,]", _):
            return "a list"
        case Apply(function, _) if function[-1] not in ":]}":
            return f"a call of the function {function!r}"
        case _:
            return "an assignment to a value"
