"""Writes expressions of our language in JavaScript; texts and remainders are what differs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Set

from parcours.model.expression import Apply, Assignment, Binary, Expression, Literal, Name, Unary, names
from parcours.model.expression.syntax import walk
from parcours.model.structure import Component, Transition
from parcours_formats.guard_languages.values import conjuncts, is_natural, replaced
from parcours_formats.losses import Losses

WORDS = frozenset(
    re.findall(
        r"\w+",
        """arguments await break case catch class const continue debugger default delete do else enum eval
        export extends false finally for function global if implements import in instanceof
        interface let new null package private protected public return static super switch this
        throw true try typeof undefined var void while with yield Math NaN Infinity""",
    )
)
"""Names that mean something there and cannot be given."""

_SIGNS = {"\n": "\\n", "\t": "\\t", "\r": "\\r", "\\": "\\\\", "'": "\\'"}


def javascript(node: Expression, naturals: Set[str] = frozenset()) -> str:
    """Return the text of an expression in JavaScript.

    >>> from parcours.model.expression import parse_expression
    >>> javascript(parse_expression("n % 2 == 0 && mode != 'it\\\\'s' && floor(n / 2) < 3"), {"n"})
    "n % 2 == 0 && mode != 'it\\\\'s' && Math.floor(n / 2) < 3"
    """
    return str(_spelled(node, naturals))


def _spelled(node: Expression, naturals: Set[str]) -> Expression:
    match node:
        case Literal(str(text)):
            # A name is rendered as it stands.
            return Name("'" + "".join(map(_sign, text)) + "'")
        case Unary("-", Unary("-", operand)):
            # Two minus signs in a row are another operator there.
            return _spelled(operand, naturals)
        case Unary(operator, operand):
            return Unary(operator, _spelled(operand, naturals))
        case Binary("==" | "!=" as operator, Binary("%", left, right), Literal(0)):
            # Languages differ in the sign of a remainder, not in whether there is one.
            return Binary(operator, Binary("%", _spelled(left, naturals), _spelled(right, naturals)), Literal(0))
        case Binary("%", left, right) if not (is_natural(left, naturals) and is_natural(right, naturals)):
            # The remainder there has the sign of the dividend, ours that of the divisor.
            one, two = _spelled(left, naturals), _spelled(right, naturals)
            return Binary("-", one, Binary("*", two, Apply("Math.floor", (Binary("/", one, two),))))
        case Binary(operator, left, right):
            return Binary(operator, _spelled(left, naturals), _spelled(right, naturals))
        case Apply(function, arguments):
            return Apply(f"Math.{function}", tuple(_spelled(each, naturals) for each in arguments))
        case _:
            return node


def _sign(sign: str) -> str:
    if sign in _SIGNS:
        return _SIGNS[sign]
    return (
        sign
        if sign.isprintable() and ord(sign) < 0x10000
        else "".join(f"\\u{unit:04x}" for unit in memoryview(sign.encode("utf-16-le", "surrogatepass")).cast("H"))
    )


class JavaScriptWriter:
    """What writers of JavaScript share: guards and actions in their words, and losses where they have none."""

    def __init__(self) -> None:
        self.losses = Losses()
        self.lose = self.losses.add
        self.spoken: dict[str, dict[str, Expression]] = {}
        """What each variable of each component is called; variables that are not written are missing."""

    def is_said(self, node: Expression, spoken: Mapping[str, Expression]) -> bool:
        """Return whether an expression has a counterpart: its variables are written, and it asks for no lists."""
        is_sized = any(isinstance(each, Apply) and each.function == "size" for each in walk(node))
        return names(node) <= spoken.keys() and not is_sized

    def conditions(self, component: Component, transition: Transition) -> Iterator[Expression]:
        """Yield the parts of a guard that have a counterpart."""
        spoken = self.spoken[component.name]
        for part in conjuncts(transition.guard) if transition.guard is not None else ():
            if self.is_said(part, spoken):
                yield replaced(part, spoken)
            else:
                what = f'the condition "{part}" is not written; the transition is free of it'
                self.lose(f"transition {transition.id!r}", transition.line, what)

    def assignments(
        self, component: Component, transition: Transition, action_of: str
    ) -> Iterator[tuple[Expression, Expression]]:
        """Yield target and value of each assignment that has a counterpart."""
        spoken = self.spoken[component.name]
        for action in transition.actions:
            if isinstance(action, Assignment) and action.target in spoken and self.is_said(action.value, spoken):
                yield spoken[action.target], replaced(action.value, spoken)
            else:
                what = f'{action_of} action "{action}" is not written'
                self.lose(f"transition {transition.id!r}", transition.line, what)
