"""Why a formula does not hold: the part that fails, the first item that breaks it, and the values compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from parcours.model.expression.evaluation import Value, evaluate
from parcours.model.expression.syntax import COMPARISONS, Apply, Binary, Each, Expression, Literal, Unary


def explain(formula: Expression, known: Mapping[str, Value]) -> str:
    """Return why a formula is false under a valuation.

    >>> from parcours.model.expression import parse_formula
    >>> explain(parse_formula("all s in way: abs(s.v) <= 2"), {"way": [{"v": 1}, {"v": -3}]})
    's = way[1]: abs(s.v) is 3, but must be <= 2'
    """
    match formula:
        case Binary("&&", left, right):
            return explain(right if evaluate(left, known) else left, known)
        case Binary("||", Unary("!", condition), right):
            return f"{explain(right, known)}; demanded because {condition}"
        case Each("all", name, first, last, body):
            items = _items(first, last, known)
            k = next(k for k, item in enumerate(items) if not evaluate(body, {**known, name: item}))
            which = f"{first}[{k}]" if last is None else f"{items[k]}"
            return f"{name} = {which}: {explain(body, {**known, name: items[k]})}"
        case Binary(sign, left, right) if sign in COMPARISONS:
            return f"{_valued(left, known)}, but must be {sign} {_valued(right, known)}"
        case Apply("near", (one, other, tolerance)):
            bound = f"within {_valued(tolerance, known)} of {_valued(other, known)}"
            return f"{_valued(one, known)}, but must be {bound}"
        case _:
            return f"{formula} is false"


def _items(first: Expression, last: Expression | None, known: Mapping[str, Value]) -> Sequence[object]:
    least = evaluate(first, known)
    if last is None:
        assert isinstance(least, Sequence)
        return least
    greatest = evaluate(last, known)
    assert isinstance(least, int) and isinstance(greatest, int)
    return range(least, greatest + 1)


def _valued(node: Expression, known: Mapping[str, Value]) -> str:
    value = evaluate(node, known)
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    constant = isinstance(node, Literal) or (isinstance(node, Unary) and isinstance(node.operand, Literal))
    return text if constant else f"{node} is {text}"
