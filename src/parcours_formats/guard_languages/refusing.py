"""Refusals of what a foreign text says and our language cannot, each naming it."""

from __future__ import annotations

from parcours.errors import BadModel
from parcours.model.expression import Expression
from parcours.model.expression.parsing import MAX_DEPTH, MAX_LENGTH
from parcours_formats.guard_languages.kinds import depth
from parcours_formats.guard_languages.tree import Applied, Identifier, Index, Member, Record, Series, Tree


def sized(node: Expression, where: str) -> Expression:
    """Return the expression if it is no longer than our own parser allows, so that it can be written and read."""
    if depth(node) >= MAX_DEPTH or len(str(node)) > MAX_LENGTH:
        rule = (
            f"a translated expression has at most {MAX_LENGTH} characters and {MAX_DEPTH} levels, but this one has more"
        )
        raise BadModel(where, rule, "split it", slug="expression-size")
    return node


def refusal(where: str, what: str) -> BadModel:
    """Return the refusal of something that our language cannot say."""
    rule = f"only arithmetic, comparisons, assignments and choices are translated, but here is {what}"
    return BadModel(where, rule, "write it with these", slug="foreign-construct")


def construct_of(tree: Tree) -> str:
    """Return what a place is that our language does not know, in words."""
    match tree:
        case Identifier(name):
            return f"the name {name!r}"
        case Member(_, name):
            return f"a field {name!r} of an object"
        case Index():
            return "an element of a list"
        case Applied(function, _):
            return f"a call of the function {function!r}"
        case Record():
            return "an object"
        case Series():
            return "a list"
        case _:
            return "an assignment to a value"
