"""A transition that reads open values -> why not every different choice of them is tried; nothing if each is."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import prod

from parcours.model.candidates import is_plain, listed
from parcours.model.expression import Expression
from parcours.model.expression.syntax import COMPARISONS, Binary, walk
from parcours.model.solutions import EFFORT, Question


def inexact(question: Question, guards: Sequence[Expression], effects: Sequence[Expression], id: str) -> str:
    """Return why the step relation may not try every different choice at a transition; empty if it does.

    Args:
        question: what is open there.
        guards: its guard, if it has one.
        effects: the expressions whose values outlive the step.
        id: the transition.

    >>> from parcours.model.expression import INT, parse_expression
    >>> question = Question({"v": INT}, {})
    >>> inexact(question, [parse_expression("v > 0")], [], "t1")
    ''
    >>> inexact(question, [parse_expression("v > 0")], [parse_expression("v + 1")], "t1")
    "t1 keeps the open value 'v'"
    """
    sizes: list[int] = []
    kept = question.terms(effects)
    if why := keeps(question, effects, kept, id):
        return why
    compared = sum(isinstance(node, Binary) and node.operator in COMPARISONS for g in guards for node in walk(g))
    for term, type_ in question.terms([*guards, *effects]).items():
        # An open number is tried at, and beside, each value that it is compared with.
        sizes.append(len(listed(question, term, type_)) or 9 + 8 * compared)
    if prod(sizes) > EFFORT:
        return f"{id} has too many open values to try them all"
    if kept and not all(is_plain(question, guard) for guard in guards):
        return f"{id} computes with open values, and not all that it may keep are found"
    return ""


def keeps(question: Question, effects: Sequence[Expression], among: Collection[str], id: str) -> str:
    """Return which of these open terms, that cannot all be tried, lives on in the effects, in words; empty if none."""
    for term, type_ in question.terms(effects).items():
        if term in among and not listed(question, term, type_):
            return f"{id} keeps the open value {term!r}"
    return ""
