"""Solves the conditions that the guards of a case put on what the tester chooses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from parcours.errors import BadModel
from parcours.model.expression import Expression, Type, evaluate, names
from parcours.model.solutions import Answer, Budget, Question

_EFFORT = 20_000  # most valuations tried for conditions that share symbols


@dataclass(slots=True)
class Conditions:
    """What is asked of the symbols of one case."""

    types: dict[str, Type] = field(default_factory=dict)
    domains: dict[str, Sequence[object]] = field(default_factory=dict)
    wanted: dict[str, object] = field(default_factory=dict)
    limits: list[Expression] = field(default_factory=list)
    hard: list[tuple[Expression, str]] = field(default_factory=list)
    soft: list[Expression] = field(default_factory=list)
    apart: list[Expression] = field(default_factory=list)  # that answers of two visits can be told apart


def solved(conditions: Conditions) -> tuple[dict[str, object], str]:
    """Return values of the symbols under which the conditions hold; or, beside some, which cannot hold together."""
    found: dict[str, object] = {}
    for symbols, hard, soft, apart in _clusters(conditions):
        if not symbols:
            for condition, where in hard:
                if _is_false(condition):
                    return found, f"{where} cannot hold"
            continue
        wanted = {name: value for name, value in conditions.wanted.items() if name in symbols}
        demands = [condition for condition, _ in hard]
        limits = [limit for limit in conditions.limits if names(limit) <= symbols]
        holds: bool | None = None
        # Given up one after the other, what matters least first: that answers differ, some of the test inputs' own
        # values, all of them, that no rival's guard holds, both of these, and at last the bounds of the test inputs.
        tries: list[tuple[list[Expression], dict[str, object]]] = [
            *([(demands + soft + apart, wanted)] if apart else []), (demands + soft, wanted),
            (demands + soft + limits, {}), (demands, wanted), (demands + limits, {}), (demands, {}),
        ]  # fmt: skip
        for guards, known in tries:
            answer = _answer(conditions, guards, known)
            if answer is None:
                continue
            holds = answer.holds
            if not holds and guards == demands + soft and len(wanted) > 1:
                known = _most(conditions, guards + limits, wanted)
                answer = (_answer(conditions, guards + limits, known) if known else None) or answer
            if answer.holds:
                holds = True
                found |= {**known, **dict(answer.values)}
                break
        if holds is False:
            return found, " and ".join(dict.fromkeys(where for _, where in hard)) + " cannot hold together"
    return found, ""


def _answer(conditions: Conditions, guards: Sequence[Expression], known: Mapping[str, object]) -> Answer | None:
    try:
        return Question(conditions.types, {}, conditions.domains, known).witness(guards, Budget(_EFFORT))
    except BadModel:
        return None


def _most(conditions: Conditions, guards: Sequence[Expression], wanted: Mapping[str, object]) -> dict[str, object]:
    """Return those of the wanted values, the first ones first, with which the guards can hold together."""
    kept: dict[str, object] = {}
    for name, value in wanted.items():
        answer = _answer(conditions, guards, {**kept, name: value})
        if answer is not None and answer.holds:
            kept[name] = value
    return kept


_Cluster = tuple[set[str], list[tuple[Expression, str]], list[Expression], list[Expression]]


def _clusters(conditions: Conditions) -> Iterator[_Cluster]:
    """Yield conditions that share symbols, hard, soft and apart, together with these; those without any first."""
    groups: list[_Cluster] = []
    everything = [
        *((one, [(one, where)], [], []) for one, where in conditions.hard),
        *((one, [], [one], []) for one in conditions.soft),
        *((one, [], [], [one]) for one in conditions.apart),
    ]
    for condition, hard, soft, apart in everything:
        joined: _Cluster = (set(names(condition)), hard, soft, apart)
        others = []
        for group in groups:
            if group[0] & joined[0] or (not group[0] and not joined[0]):
                joined = (joined[0] | group[0], group[1] + joined[1], group[2] + joined[2], group[3] + joined[3])
            else:
                others.append(group)
        groups = [*others, joined]
    yield from sorted(groups, key=lambda group: bool(group[0]))


def _is_false(condition: Expression) -> bool:
    try:
        return evaluate(condition, {}) is False
    except BadModel:
        return True
