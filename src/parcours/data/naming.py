"""Names in rules: repeated inputs are numbered, fields become columns, names of values and of blocks become numbers.

A row may repeat its inputs, say three times: x, y become x1, y1, x2, y2, x3, y3. A rule over `each` replica names the
inputs plainly (`x > 1`); a rule over `pairs` names both partners (`a.x < b.x`); a rule over the `row` names columns
(`x1 < x2`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import partial, reduce
from itertools import combinations
from typing import Literal as Choice
from typing import TypeAlias

from parcours.model.expression import Binary, Expression, Literal, Name, Unary
from parcours.model.expression.syntax import substitute
from parcours.model.solutions import term_of

Scope: TypeAlias = Choice["row", "each", "pairs"]
"""What a rule speaks of."""

SCOPES: tuple[Scope, ...] = ("row", "each", "pairs")


def numbered_name(name: str, replica: int) -> str:
    """Return a name as one replica calls it, counted from 1; the number stands before the component of a vector.

    >>> numbered_name("v", 2), numbered_name("position.x", 2)
    ('v2', 'position2.x')
    """
    head, dot, tail = name.partition(".")
    return f"{head}{replica}{dot}{tail}"


def copies(scope: Scope, replicas: int) -> list[tuple[int, ...]]:
    """Return the replicas that each constraint of a rule speaks of: one constraint an entry.

    >>> [copies(scope, 3) for scope in SCOPES]
    [[()], [(1,), (2,), (3,)], [(1, 2), (1, 3), (2, 3)]]
    """
    return list(combinations(range(1, replicas + 1), SCOPES.index(scope)))


def instances(
    name: str, scope: Scope, rule: Expression, inputs: Collection[str], replicas: int
) -> Iterator[tuple[str, Expression]]:
    """Yield each constraint that a rule stands for, with its name; `inputs` are the names before they are numbered.

    >>> from parcours.model.expression import parse_expression
    >>> for made in instances("order", "pairs", parse_expression("a.x < b.x"), {"x"}, 3):
    ...     print(*made)
    order(1, 2) x1 < x2
    order(1, 3) x1 < x3
    order(2, 3) x2 < x3
    """
    for numbers in copies(scope, replicas):
        if numbers:
            yield f"{name}({', '.join(map(str, numbers))})", substitute(rule, partial(_numbered, inputs, numbers))
        else:
            yield name, rule


def _numbered(inputs: Collection[str], numbers: tuple[int, ...], node: Expression) -> Expression | None:
    name, number = term_of(node) or "", numbers[0]
    if len(numbers) > 1:
        partner, _, name = name.partition(".")
        if partner not in ("a", "b"):
            return None
        number = numbers["ab".index(partner)]
    return Name(numbered_name(name, number)) if name in inputs else None


def flat(rule: Expression, columns: Collection[str]) -> Expression:
    """Return the rule with each field that is a column, such as `position.x`, as one name."""

    def column(node: Expression) -> Expression | None:
        path = term_of(node)
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
        # Words stand for places, and two inputs may have the same word at different places.
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
