"""Solves guards that do more with open values than compare them, for one value after the other.

A comparison such as `credit + c.value <= 20` is taken as linear in one open term at a time, the others being fixed:
two evaluations give the value at which it changes, and that value and its neighbours are tried. Where the guard has
one open integer and is linear in it, that is exact: nothing found means that nothing fits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice, pairwise

from parcours.errors import BadModel
from parcours.model.expression import Binary, Expression, Literal, Type, Unary, evaluate
from parcours.model.expression.evaluation import INTEGER_LIMIT
from parcours.model.expression.syntax import COMPARISONS, walk
from parcours.model.solutions import Question, Values, comparisons, hold, is_boxed, term_of, with_terms

MOST_TRIED = 1 << 12
"""Most valuations that are tried for one guard."""

Chosen = dict[str, object]


def may_hold(guard: Expression, known: Mapping[str, object]) -> bool:
    """Return whether a guard holds, or reads what has no value, so that it might."""
    try:
        return evaluate(guard, known) is True
    except BadModel as error:
        return error.slug == "no-value"


def likely(question: Question, guard: Expression) -> Iterator[Values]:
    """Yield valuations of a guard's open terms under which it holds, not always all and some of them twice."""
    search = _Search(question, guard)
    for order in search.orders():
        for chosen in islice(search.filled({}, order), MOST_TRIED):
            if hold([guard], with_terms(question.known, chosen)):
                yield tuple(sorted(chosen.items()))


def is_linear(question: Question, guard: Expression) -> bool:
    """Return whether a guard has one open integer whose values are not all tried, and compares what is linear in it."""
    cut = question.endless([guard])
    return [type_.name for type_ in cut.values()] == ["int"] and _linear_guard(guard, *cut)


def is_plain(question: Question, guard: Expression) -> bool:
    """Return whether a guard compares its open terms, where they cannot all be tried, alone with what is not such."""
    return is_boxed(guard, question.endless([guard]))


class _Search:
    def __init__(self, question: Question, guard: Expression) -> None:
        self._question, self._guard = question, guard
        self._terms = question.terms([guard])
        self._comparisons = comparisons(guard)
        self._literals = [node.value for node in walk(guard) if isinstance(node, Literal)]

    def orders(self) -> list[list[str]]:
        cut = list(self._question.endless([self._guard]))
        few = [term for term in self._terms if term not in cut]
        return [few + cut, few + cut[::-1]] if len(cut) > 1 else [few + cut]

    def filled(self, chosen: Chosen, left: list[str]) -> Iterator[Chosen]:
        if not left:
            yield chosen
            return
        for value in self._values(left[0], chosen):
            yield from self.filled({**chosen, left[0]: value}, left[1:])

    def _values(self, term: str, chosen: Chosen) -> Sequence[object]:
        type_ = self._terms[term]
        if few := self._question.listed(term, type_):
            return few
        if type_.name in ("text", "enum"):
            said = sorted({each for each in self._literals if isinstance(each, str)} | set(self._texts(chosen)))
            return type_.values or [*said, "other" + "".join(said)]
        cuts: set[int | float] = {0, *(each for each in self._literals if isinstance(each, int | float))}
        cuts.update(self._roots(term, chosen))
        if type_.name == "real":
            found = _reals(sorted(map(float, cuts)))
            return [each for each in found if each >= 0] if type_.is_clock else found
        near = {math.floor(cut) + step for cut in cuts for step in (-1, 0, 1, 2)}
        domain = self._question.domains.get(term, ())
        if domain:
            near |= {end for end in (domain[0], domain[-1]) if isinstance(end, int)}
        least = 0 if term.startswith("size(") else -INTEGER_LIMIT
        fit = [each for each in near if least <= each <= INTEGER_LIMIT and (not domain or each in domain)]
        return sorted(fit, key=lambda each: (abs(each), each))

    def _roots(self, term: str, chosen: Chosen) -> Iterator[int | float]:
        # Where each comparison changes, if it is linear in the term.
        rest = {other: _first(type_) for other, type_ in self._terms.items() if other not in chosen}
        at = [with_terms(self._question.known, {**rest, **chosen, term: value}) for value in (0, 1)]
        for left, right in self._comparisons:
            try:
                gaps = [_gap(evaluate(left, known), evaluate(right, known)) for known in at]
            except BadModel:
                continue
            if gaps[0] is None or gaps[1] is None or gaps[0] == gaps[1]:
                continue
            offset, slope = gaps[0], gaps[1] - gaps[0]
            root = -offset // slope if isinstance(offset, int) and isinstance(slope, int) else -offset / slope
            if self._terms[term].name == "real":
                root = -offset / slope
            if math.isfinite(root):
                yield root

    def _texts(self, chosen: Chosen) -> Iterator[str]:
        known = with_terms(self._question.known, chosen)
        for side in (side for sides in self._comparisons for side in sides):
            try:
                value = evaluate(side, known)
            except BadModel:
                continue
            if isinstance(value, str):
                yield value


def _gap(left: object, right: object) -> int | float | None:
    if not _is_number(left) or not _is_number(right):
        return None
    gap = left - right  # type: ignore[operator]
    return gap if math.isfinite(gap) else None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _first(type_: Type) -> object:
    if type_.values:
        return type_.values[0]
    return {"bool": False, "int": 0, "real": 0.0}.get(type_.name, "")


def _reals(cuts: list[float]) -> list[float]:
    beyond = [cuts[0] - max(1.0, abs(cuts[0])), cuts[-1] + max(1.0, abs(cuts[-1]))]
    between = [this / 2 + following / 2 for this, following in pairwise(cuts)]
    return [each for each in sorted({*cuts, *beyond, *between}) if math.isfinite(each)]


def _linear_guard(node: Expression, term: str) -> bool:
    match node:
        case _ if not any(term_of(part) == term for part in walk(node)):
            return True
        case Binary(operator, left, right) if operator in COMPARISONS:
            return _is_affine(left, term) and _is_affine(right, term)
        case Binary(_, left, right):
            return _linear_guard(left, term) and _linear_guard(right, term)
        case Unary(_, operand):
            return _linear_guard(operand, term)
        case _:
            return False


def _is_affine(node: Expression, term: str) -> bool:
    if term_of(node) == term or not any(term_of(part) == term for part in walk(node)):
        return not any(isinstance(part, Literal) and isinstance(part.value, float) for part in walk(node))
    match node:
        case Unary("-", operand):
            return _is_affine(operand, term)
        case Binary("+" | "-", left, right):
            return _is_affine(left, term) and _is_affine(right, term)
        case Binary("*", left, right):
            held = [any(term_of(part) == term for part in walk(side)) for side in (left, right)]
            return not all(held) and _is_affine(left, term) and _is_affine(right, term)
        case _:
            return False
