"""Names in a rule become numbers: fields of a vector its columns, names of an enumeration or of blocks their places."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import reduce

from parcours.data.constraints import substitute
from parcours.model.expression import Binary, Expression, Field, Literal, Name, Unary


def path_of(node: Expression) -> str | None:
    """Return the name that a node spells out, dots included, or None if it is no name.

    >>> path_of(Field(Name("position"), "x")), path_of(Literal(1))
    ('position.x', None)
    """
    match node:
        case Name(id):
            return id
        case Field(of, name):
            before = path_of(of)
            return None if before is None else f"{before}.{name}"
        case _:
            return None


def flat(rule: Expression, columns: Collection[str]) -> Expression:
    """Return the rule with each field that is a column, such as `position.x`, as one name."""

    def column(node: Expression) -> Expression | None:
        path = path_of(node)
        return Name(path) if path is not None and path in columns else None

    return substitute(rule, column)


def numbered_words(rule: Expression, words: Mapping[str, tuple[str, ...]]) -> Expression:
    """Return the rule over numbers: each word that an input is compared with as its place among that input's words.

    >>> from parcours.model.expression import parse_expression
    >>> str(numbered_words(parse_expression("mode == 'off' || n < 2"), {"mode": ("on", "off")}))
    'mode == 1 || n < 2'
    """

    def compared(node: Expression) -> Expression | None:
        if not (isinstance(node, Binary) and node.operator in ("==", "!=")):
            return None
        left, right = (_words_of(side, words) for side in (node.left, node.right))
        if left is None or right is None:
            return None
        shared = [(left.index(word), right.index(word)) for word in left if word in right]
        if left == right and len(left) > 1:
            return None  # two inputs with the same words: equal words, equal numbers
        pairs = [
            Binary("&&", _is(node.left, i), _is(node.right, j)) if len(right) > 1 and len(left) > 1
            else _is(node.left, i) if len(left) > 1 else _is(node.right, j)
            for i, j in shared
        ]  # fmt: skip
        same = reduce(lambda a, b: Binary("||", a, b), pairs) if pairs else Literal(False)
        return same if node.operator == "==" else Unary("!", same)

    return substitute(rule, compared)


def _words_of(side: Expression, words: Mapping[str, tuple[str, ...]]) -> tuple[str, ...] | None:
    if isinstance(side, Literal) and isinstance(side.value, str):
        return (side.value,)
    return words.get(side.id) if isinstance(side, Name) else None


def _is(side: Expression, place: int) -> Expression:
    return Literal(True) if isinstance(side, Literal) else Binary("==", side, Literal(place))
