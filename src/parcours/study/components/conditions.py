"""Solves the conditions on the symbols of a case, or names those that contradict each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from parcours.errors import BadModel
from parcours.model.expression import Expression, Type, evaluate, names
from parcours.model.solutions import Budget, Question

_EFFORT = 20_000  # Most valuations tried for conditions that share symbols


@dataclass(slots=True)
class Conditions:
    """What is asked of the symbols of one case."""

    types: dict[str, Type] = field(default_factory=dict)
    domains: dict[str, Sequence[object]] = field(default_factory=dict)
    wanted: dict[str, object] = field(default_factory=dict)
    limits: list[Expression] = field(default_factory=list)
    hard: list[tuple[Expression, str]] = field(default_factory=list)
    soft: list[Expression] = field(default_factory=list)


def solved(conditions: Conditions) -> tuple[dict[str, object], str]:
    """Return values of the symbols under which the conditions hold; or, beside some, which cannot hold together."""
    found: dict[str, object] = {}
    for symbols, hard, soft in _clusters(conditions):
        if not symbols:
            for condition, where in hard:
                if _is_false(condition):
                    return found, f"{where} cannot hold"
            continue
        wanted = {name: value for name, value in conditions.wanted.items() if name in symbols}
        demands = [condition for condition, _ in hard]
        limits = [limit for limit in conditions.limits if names(limit) <= symbols]
        holds: bool | None = None
        tries: tuple[tuple[list[Expression], dict[str, object]], ...]
        tries = ((demands + soft, wanted), (demands + soft + limits, {}), (demands, wanted), (demands + limits, {}))
        for guards, known in (*tries, (demands, {})):
            question = Question(conditions.types, {}, conditions.domains, known)
            try:
                answer = question.witness(guards, Budget(_EFFORT))
            except BadModel:
                continue
            holds = answer.holds
            if holds:
                found |= {**known, **dict(answer.values)}
                break
        if holds is False:
            return found, " and ".join(dict.fromkeys(where for _, where in hard)) + " cannot hold together"
    return found, ""


def _clusters(conditions: Conditions) -> Iterator[tuple[set[str], list[tuple[Expression, str]], list[Expression]]]:
    """Yield conditions that share symbols, together with these; those without any first."""
    groups: list[tuple[set[str], list[tuple[Expression, str]], list[Expression]]] = []
    everything = [(one, where) for one, where in conditions.hard] + [(one, None) for one in conditions.soft]
    for condition, where in everything:
        symbols = set(names(condition))
        joined: tuple[set[str], list[tuple[Expression, str]], list[Expression]] = (symbols, [], [])
        (joined[1].append((condition, where)) if where is not None else joined[2].append(condition))
        apart = []
        for group in groups:
            if group[0] & symbols or (not group[0] and not symbols):
                joined = (joined[0] | group[0], group[1] + joined[1], group[2] + joined[2])
            else:
                apart.append(group)
        groups = [*apart, joined]
    yield from sorted(groups, key=lambda group: bool(group[0]))


def _is_false(condition: Expression) -> bool:
    try:
        return evaluate(condition, {}) is False
    except BadModel:
        return True
