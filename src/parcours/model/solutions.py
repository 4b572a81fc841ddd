"""Finds values under which guards hold together, or that there are none.

Finite domains are enumerated. Reals, large integers and texts that the guards only compare with other values
are cut at those values, which is exact too: between two neighbouring cuts no guard changes. Anything else is
tried at likely values, and when none fits the answer is that it could not be decided.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

from parcours.errors import BadModel
from parcours.model.expression import Apply, Binary, Expression, FieldAccess, Literal, Name, Type, evaluate
from parcours.model.expression.evaluation import INTEGER_LIMIT
from parcours.model.expression.syntax import COMPARISONS, parts, walk
from parcours.model.scope import Classes

ENUMERABLE = 64
"""Integer ranges up to this size are enumerated; larger ones are cut at the values they are compared with."""

EFFORT = 1 << 14
"""Most valuations tried for one question."""


Values = tuple[tuple[str, object], ...]
"""A value for each open term, sorted. A term is `x`, `ob.x` or `size(ob.path)`."""


@dataclass(slots=True)
class Budget:
    """How many valuations may still be tried, over many questions."""

    left: int = 1 << 18


@dataclass(frozen=True, slots=True)
class Answer:
    """`holds` with the values that show it, or not, or None for undecided."""

    holds: bool | None
    values: Values = ()

    def __str__(self) -> str:
        return ", ".join(f"{term} = {_shown(value)}" for term, value in self.values)


@dataclass(frozen=True, slots=True)
class Question:
    """What the guards of one component are asked about.

    Args:
        types: the type of each name.
        classes: the fields of each message class.
        domains: the declared domain of each name that has one.
        known: the values of the names that are fixed; a message may have some of its fields only.
    """

    types: Mapping[str, Type]
    classes: Classes
    domains: Mapping[str, Sequence[object]] = field(default_factory=dict)
    known: Mapping[str, object] = field(default_factory=dict)

    def witness(self, guards: Sequence[Expression], budget: Budget | None = None) -> Answer:
        """Return whether all guards can hold together, with the first values found.

        A valuation under which a guard has no value (division by zero) does not count. The guards must be
        well typed.
        """
        for values, holds in self.valuations(guards, (), budget):
            return Answer(holds, values)
        return Answer(False)

    def valuations(
        self, guards: Sequence[Expression], others: Sequence[Expression] = (), budget: Budget | None = None
    ) -> Iterator[tuple[Values, bool | None]]:
        """Yield valuations of the open terms under which the guards hold, each with True.

        They give values to what `others` read, too.

        When the search was not complete and found nothing, the last and only one is empty, with None.
        """
        terms = self.terms([*guards, *others])
        finite = {term: domain for term, type_ in terms.items() if (domain := self.listed(term, type_))}
        cut = {term: type_ for term, type_ in terms.items() if term not in finite}
        exact, found, tried = all(is_boxed(guard, cut) for guard in guards), False, 0
        for combination in product(*finite.values()):
            chosen = dict(zip(finite, combination, strict=True))
            sides = self._sides(guards, cut, chosen, exact)
            candidates = [self._candidates(term, type_, sides[term], exact) for term, type_ in cut.items()]
            for values in product(*candidates):
                tried += 1
                if budget is not None:
                    budget.left -= 1
                if tried > EFFORT or (budget is not None and budget.left < 0):
                    if not found:
                        yield (), None
                    return
                valuation = chosen | dict(zip(cut, values, strict=True))
                if hold(guards, with_terms(self.known, valuation)):
                    found = True
                    yield tuple(sorted(valuation.items())), True
        if not found and not exact:
            yield (), None

    def terms(self, expressions: Sequence[Expression]) -> dict[str, Type]:
        """Return the open terms that the expressions read, with their types, sorted by name."""
        return dict(sorted((pair for each in expressions for pair in self._free(each)), key=lambda pair: pair[0]))

    def _free(self, node: Expression) -> Iterator[tuple[str, Type]]:
        match node:
            case Name() | FieldAccess():
                path = _path(node)
                type_ = self._typed(path)
                # A message as a whole, passed on in a payload, has no value to choose.
                if not self._is_known(path) and type_ is not None and _is_base(type_):
                    yield ".".join(path), type_
            case Apply("size", (Name() | FieldAccess() as chain,)):
                if not self._is_known(path := _path(chain)):
                    yield f"size({'.'.join(path)})", Type("int")
            case _:
                for part in parts(node):
                    yield from self._free(part)

    def _typed(self, path: list[str]) -> Type | None:
        type_ = self.types.get(path[0])
        for part in path[1:]:
            type_ = self.classes.get(type_.name, {}).get(part) if type_ is not None else None
        return type_

    def _is_known(self, path: list[str]) -> bool:
        place: object = self.known
        for part in path:
            if not isinstance(place, Mapping) or part not in place:
                return False
            place = place[part]
        return True

    def listed(self, term: str, type_: Type) -> Sequence[object]:
        """Return all values of a term where they are few enough to be tried one by one, else nothing."""
        if type_.name == "bool":
            return (False, True)
        domain = self.domains.get(term) or type_.values
        return domain if len(domain) <= ENUMERABLE else ()

    def endless(self, expressions: Sequence[Expression]) -> dict[str, Type]:
        """Return those open terms of expressions whose values cannot all be tried."""
        return {term: type_ for term, type_ in self.terms(expressions).items() if not self.listed(term, type_)}

    def _sides(
        self, guards: Sequence[Expression], cut: Mapping[str, Type], chosen: Mapping[str, object], exact: bool
    ) -> dict[str, set[object]]:
        # What each cut term is compared with, where that has a value.
        found: dict[str, set[object]] = {term: set() for term in cut}
        if not cut:
            return found
        full = with_terms(self.known, chosen)
        for guard in guards:
            for left, right in comparisons(guard):
                for side, other in ((left, right), (right, left)):
                    if (term := term_of(side)) in found and not any(term_of(part) in cut for part in walk(other)):
                        try:
                            found[term].add(evaluate(other, full))
                        except BadModel:
                            continue
            for term, type_ in () if exact else cut.items():
                found[term] |= {
                    part.value for part in walk(guard) if isinstance(part, Literal) and _like(part.value, type_)
                }
        return found

    def _candidates(self, term: str, type_: Type, sides: set[object], exact: bool) -> list[object]:
        if type_.name in ("text", "enum"):
            texts = sorted(side for side in sides if isinstance(side, str))
            return [*(type_.values or [*texts, "other" + "".join(texts)])]
        numbers = sorted({float(side) for side in sides if isinstance(side, int | float)})
        if not exact:
            numbers = sorted({-1.0, 0.0, 1.0, *numbers})
        if type_.is_clock:
            return [value for value in _between(sorted({0.0, *numbers})) if value >= 0]
        if type_.name == "real":
            return list(_between(numbers))
        return self._integers(term, sides | set(numbers))

    def _integers(self, term: str, sides: set[object]) -> list[object]:
        low, high = -INTEGER_LIMIT, INTEGER_LIMIT
        near = {0}
        if term.startswith("size("):
            low = 0
        elif domain := self.domains.get(term):
            ends = [end for end in (domain[0], domain[-1]) if isinstance(end, int)]
            low, high = min(ends), max(ends)
            near |= {low, high}
        for side in sides:
            if isinstance(side, int | float):
                near |= {math.floor(side) - 1, math.floor(side), math.ceil(side), math.ceil(side) + 1}
        return [value for value in sorted(near) if low <= value <= high]


def hold(guards: Sequence[Expression], known: Mapping[str, object]) -> bool:
    """Return whether all guards have a value, and hold."""
    try:
        return all(evaluate(guard, known) is True for guard in guards)
    except BadModel:
        return False


def with_terms(known: Mapping[str, object], values: Mapping[str, object]) -> dict[str, object]:
    """Return the known values with those of terms added, messages as nested mappings, for `evaluate`.

    >>> with_terms({"ob": {"x": 1.0}}, {"ob.y": 2.0, "size(path)": 3})
    {'ob': {'x': 1.0, 'y': 2.0}, 'path': range(0, 3)}
    """
    result = dict(known)
    for term, value in values.items():
        sized = term.startswith("size(")
        path = (term[5:-1] if sized else term).split(".")
        place = result
        for part in path[:-1]:
            inner = place.get(part)
            place[part] = copy = dict(inner) if isinstance(inner, Mapping) else {}
            place = copy
        place[path[-1]] = range(value) if sized and isinstance(value, int) else value
    return result


def _between(cuts: list[float]) -> Iterator[float]:
    # One value below, at, between and above the cuts, since no guard changes in between:
    #
    #     ──x────|────x────|────x──    | cut, which is tried too    x one value for its whole interval
    if not cuts:
        yield 0.0
        return
    yield max(cuts[0] - max(1.0, abs(cuts[0])), -1.7e308)
    for this, following in zip(cuts, [*cuts[1:], None], strict=True):
        yield this
        if following is not None:
            yield this / 2 + following / 2
    yield min(cuts[-1] + max(1.0, abs(cuts[-1])), 1.7e308)


def is_boxed(guard: Expression, cut: Mapping[str, Type]) -> bool:
    """Return whether each cut term is only compared, alone, with what holds no cut term."""
    for left, right in comparisons(guard):
        within = [any(term_of(part) in cut for part in walk(side)) for side in (left, right)]
        alone = term_of(left) in cut or term_of(right) in cut
        if any(within) and (not alone or all(within)):
            return False
    return True


def comparisons(guard: Expression) -> list[tuple[Expression, Expression]]:
    """Return both sides of each comparison in a guard."""
    binaries = (node for node in walk(guard) if isinstance(node, Binary))
    return [(node.left, node.right) for node in binaries if node.operator in COMPARISONS]


def term_of(node: Expression) -> str | None:
    """Return the term that a node spells out, or None if it is not one."""
    match node:
        case Name() | FieldAccess():
            return ".".join(_path(node))
        case Apply("size", (Name() | FieldAccess() as chain,)):
            return f"size({'.'.join(_path(chain))})"
        case _:
            return None


def _path(node: Expression) -> list[str]:
    parts: list[str] = []
    while isinstance(node, FieldAccess):
        parts.append(node.name)
        node = node.of
    return [str(node), *reversed(parts)]


def _is_base(type_: Type) -> bool:
    return type_.rank == 0 and type_.name in ("bool", "int", "real", "enum", "text")


def _like(value: object, type_: Type) -> bool:
    return isinstance(value, str) == (type_.name in ("text", "enum")) and not isinstance(value, bool)


def _shown(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)
