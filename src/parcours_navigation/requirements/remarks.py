"""What looks wrong with requirements although they can be judged: remarks for their author."""

from __future__ import annotations

from collections.abc import Iterator

from parcours_navigation.requirements.requirement import Requirements
from parcours_navigation.requirements.syntax import Comparison, Junction, Node, Not, Signal, render, signals


def remarks(requirements: Requirements, *, signals_imminent: bool) -> Iterator[tuple[str, str, str]]:
    """Yield (slug, what is seen, remedy).

    Args:
        signals_imminent: whether the planner can signal imminent collision.

    >>> from parcours_navigation.requirements.requirement import requirements_of
    >>> asked = requirements_of({"stops": "clearance < 0.1 -> eventually[0, 1.5 s] speed < 0.01"})
    >>> for slug, seen, remedy in remarks(asked, signals_imminent=True):
    ...     print(slug, seen, remedy, sep="; ")
    require-start; requirement 'stops' asks 'clearance < 0.1' of the first sample only; write always (...) around it
    """
    for one in requirements.formulas:
        for part in _at_start(one.formula):
            seen = f"requirement {one.name!r} asks {render(part)!r} of the first sample only"
            yield "require-start", seen, "write always (...) around it"
            break
        if "imminent" in signals(one.formula) and not signals_imminent:
            seen = f"requirement {one.name!r} reads imminent, but this planner has no way to signal it"
            yield "require-imminent", seen, "ask for it by clearance and speed"


def _at_start(node: Node) -> Iterator[Node]:
    """Yield what stands outside any temporal operator, left to right."""
    match node:
        case Comparison() | Signal():
            yield node
        case Not(operand):
            yield from _at_start(operand)
        case Junction(_, left, right):
            yield from _at_start(left)
            yield from _at_start(right)
