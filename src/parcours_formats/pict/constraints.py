"""Translates the constraints of a PICT model to conditions of our expression language.

    constraint := IF predicate THEN predicate [ELSE predicate] ;  |  predicate ;
    predicate  := conjunction (OR conjunction)*          conjunction := clause (AND clause)*
    clause     := NOT clause | ( predicate ) | term
    term       := [P] relation value | [P] relation [Q] | [P] [NOT] IN { value, ... } | [P] [NOT] LIKE "pattern"
                | IsNegative([P]) | IsPositive([P])

A term over texts is the set of values that meet it, so that order, LIKE and case are settled here.
"""

from __future__ import annotations

import fnmatch
import operator
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from parcours.data.constraints import Constraint
from parcours.data.domains import Domain
from parcours.data.inputs import constraint_of
from parcours.data.schema import MAX_COLUMNS
from parcours.errors import BadDomain, one_of
from parcours.model.expression import Binary, Expression, Literal, Name, Unary
from parcours_formats.naming import UniqueNames
from parcours_formats.token_stream import TokenStream

MAX_TERMS = 100_000
"""Most comparisons that the constraints of a file become."""

MAX_DEPTH = 50
"""Deepest nesting of brackets and NOT."""

_RELATIONS: dict[str, tuple[str, Callable[[Any, Any], bool]]] = {
    "=": ("==", operator.eq), "<>": ("!=", operator.ne), "<": ("<", operator.lt),
    "<=": ("<=", operator.le), ">": (">", operator.gt), ">=": (">=", operator.ge),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class PictParameter:
    """A parameter of a PICT model: its name there, its domain here, whether its values are numbers."""

    title: str
    domain: Domain
    is_number: bool

    @property
    def words(self) -> tuple[str, ...]:
        """Its values as texts; those of numbers read back to the same number."""
        return tuple(repr(b.low) for b in self.domain.choices) if self.is_number else self.domain.values


def constraints_in(
    text: str, first_line: int, origin: str, parameters: Mapping[str, PictParameter]
) -> Iterator[Constraint]:
    """Yield the constraints of the last part of a PICT model."""
    parser = _Parser(text, first_line, origin, parameters)
    domains = [parameter.domain for parameter in parameters.values()]
    names, count = UniqueNames(), 0
    while parser.kind != "end":
        line = parser.line
        rule = parser.constraint()
        count += 1
        if count > MAX_COLUMNS:
            parser.fail(f"a model has at most {MAX_COLUMNS} constraints, but this one has more", slug="columns")
        yield constraint_of(names.label(f"line_{line}"), rule, domains)


class _Parser(TokenStream):
    pattern = re.compile(
        r"""(?P<blank>\s+)
          | (?P<parameter>\[[^\[\]\n]{1,200}\])
          | (?P<text>"(?:[^"\\\n]|\\.)*")
          | (?P<number>[-+]?(?:[0-9]{1,19}(?:\.[0-9]{0,19})?|\.[0-9]{1,19})(?:[eE][-+]?[0-9]{1,3})?)
          | (?P<relation><>|<=|>=|=|<|>)
          | (?P<sign>[A-Za-z]{1,20}|[(){},;])""",
        re.VERBOSE,
    )
    slug = "pict-syntax"
    error = BadDomain

    def __init__(self, text: str, first_line: int, origin: str, parameters: Mapping[str, PictParameter]) -> None:
        self.parameters, self.depth, self.n_terms = parameters, 0, 0
        super().__init__(text, origin, first_line)
        while self.kind != "end":  # a sign that starts no token is the first thing to say
            self.advance()
        super().__init__(text, origin, first_line)

    def advance(self) -> None:
        super().advance()
        if self.kind == "strange":
            self.fail(f"a constraint cannot go on with {self.text[self.at]!r}")

    def constraint(self) -> Expression:
        if not self.accept("IF"):
            rule = self.predicate()
        else:
            if_ = self.predicate()
            self.expect("THEN")
            rule = Binary("||", Unary("!", if_), self.predicate())
            if self.accept("ELSE"):
                rule = Binary("&&", rule, Binary("||", if_, self.predicate()))
        self.expect(";")
        return rule

    def predicate(self) -> Expression:
        parts = [self.conjunction()]
        while self.accept("OR"):
            parts.append(self.conjunction())
        return _joined("||", parts)

    def conjunction(self) -> Expression:
        parts = [self.clause()]
        while self.accept("AND"):
            parts.append(self.clause())
        return _joined("&&", parts)

    def clause(self) -> Expression:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            self.fail(f"brackets and NOT nest at most {MAX_DEPTH} deep, but here deeper", slug="expression-size")
        if self.accept("NOT"):
            found: Expression = Unary("!", self.clause())
        elif self.accept("("):
            found = self.predicate()
            self.expect(")")
        elif (wants_negative := self.accept("IsNegative")) or self.accept("IsPositive"):
            self.expect("(")
            parameter = self.parameter()
            self.expect(")")
            invalid = set(parameter.words[len(parameter.domain.blocks) :])
            found = self.among(parameter, lambda word: (word in invalid) == wants_negative)
        else:
            found = self.term()
        self.depth -= 1
        return found

    def term(self) -> Expression:
        left = self.parameter()
        is_negated = self.accept("NOT")
        if self.accept("IN"):
            values = self.values()
            found = self.among(left, lambda word: any(_equal(left, word, value) for value in values))
        elif self.accept("LIKE"):
            if self.kind != "text" or left.is_number:
                self.fail(f"LIKE compares texts, but this is {left.title!r} and {self.shown(40)}", slug="pict-type")
            pattern = _pattern(str(self.value()))
            found = self.among(left, lambda word: bool(pattern.fullmatch(word.casefold())))
        elif self.kind == "relation" and not is_negated:
            sign, holds = _RELATIONS[self.token]
            self.advance()
            found = self.related(left, sign, holds)
        else:
            self.fail(f"a relation, IN or LIKE must stand here, but this is {self.shown(40)!r}")
        return Unary("!", found) if is_negated else found

    def related(self, left: PictParameter, sign: str, holds: Callable[[Any, Any], bool]) -> Expression:
        if self.kind == "parameter":
            right = self.parameter()
            if left.is_number != right.is_number:
                rule = f"only like parameters compare, but {left.title!r} and {right.title!r} do not"
                self.fail(rule, slug="pict-type")
            if left.is_number:
                return self.counted(1, Binary(sign, Name(left.domain.name), Name(right.domain.name)))
            pairs = list(product(left.domain.values, right.domain.values))
            self.counted(len(pairs), Literal(True))
            found = [(a, b) for a, b in pairs if holds(a.casefold(), b.casefold())]
            return _any(Binary("&&", _is(left, a), _is(right, b)) for a, b in found)
        value = self.value()
        if left.is_number:
            if isinstance(value, str):
                self.fail(f"{left.title!r} has numbers, but is compared with {value[:40]!r}", slug="pict-type")
            return self.counted(1, Binary(sign, Name(left.domain.name), _literal(value)))
        wanted = str(value).casefold()
        return self.among(left, lambda word: holds(word.casefold(), wanted))

    def among(self, parameter: PictParameter, meets: Callable[[str], bool]) -> Expression:
        """Return the condition that the parameter has one of the values that meet a condition of Python."""
        found = [word for word in parameter.words if meets(word)]
        others = sorted(set(parameter.words).difference(found), key=parameter.words.index)
        self.counted(len(parameter.words), Literal(True))
        # The shorter list is written: `not x` for all but one, instead of many alternatives.
        if len(others) < len(found):
            return Unary("!", _any(_is(parameter, word) for word in others))
        return _any(_is(parameter, word) for word in found)

    def counted(self, n: int, found: Expression) -> Expression:
        self.n_terms += n
        if self.n_terms > MAX_TERMS:
            self.fail(f"constraints become at most {MAX_TERMS} comparisons, but these more", slug="pict-size")
        return found

    def parameter(self) -> PictParameter:
        if self.kind == "end":
            self.fail("a constraint must end with ';', but the file ends")
        title = self.token[1:-1].strip()
        found = self.parameters.get(title.casefold()) if self.kind == "parameter" else None
        if found is None:
            rule = f"a parameter in square brackets must stand here, but this is {self.shown(60)!r}"
            known = [each.title for each in self.parameters.values()][:20]
            self.fail(rule, one_of(title[:60], known), slug="unknown-name")
        self.advance()
        return found

    def values(self) -> list[str | float]:
        self.expect("{")
        found = [self.value()]
        while self.accept(","):
            found.append(self.value())
        self.expect("}")
        return found

    def value(self) -> str | float:
        kind, text = self.kind, self.token
        if kind not in ("text", "number"):
            self.fail(f'a value must be a "text" or a number, but this is {self.shown(40)!r}')
        self.advance()
        return float(text) if kind == "number" else re.sub(r"\\(.)", r"\1", text[1:-1])

    def shown(self, most: int) -> str:
        return "the end" if self.kind == "end" else self.token[:most]

    def accept(self, sign: str) -> bool:
        found = self.kind == "sign" and self.token.casefold() == sign.casefold()
        if found:
            self.advance()
        return found

    def expect(self, sign: str) -> None:
        if not self.accept(sign):
            self.fail(f"{sign!r} must stand here, but this is {self.shown(40)!r}")


def _joined(sign: str, parts: Sequence[Expression]) -> Expression:
    """Return the parts joined as a balanced tree, so that its depth grows with their logarithm only."""
    if len(parts) == 1:
        return parts[0]
    half = len(parts) // 2
    return Binary(sign, _joined(sign, parts[:half]), _joined(sign, parts[half:]))


def _any(parts: Iterator[Expression]) -> Expression:
    return _joined("||", list(parts) or [Literal(False)])


def _is(parameter: PictParameter, word: str) -> Expression:
    return Binary("==", Name(parameter.domain.name), _literal(float(word)) if parameter.is_number else Literal(word))


def _equal(parameter: PictParameter, word: str, value: str | float) -> bool:
    if parameter.is_number:
        return not isinstance(value, str) and float(word) == value
    return word.casefold() == str(value).casefold()


def _literal(value: float) -> Expression:
    plain = int(abs(value)) if value.is_integer() and abs(value) < 2**53 else abs(value)
    return Unary("-", Literal(plain)) if value < 0 else Literal(plain)


def _pattern(pattern: str) -> re.Pattern[str]:
    """Return PICT's wildcards, * and ? only, as a regular expression; runs of * are one, so that matching is fast."""
    plain = re.sub(r"\*+", "*", pattern.casefold()).replace("[", "[[]")
    return re.compile(fnmatch.translate(plain))
