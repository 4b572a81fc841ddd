"""Rules about one row, each replica or every pair of replicas become constraints over the columns of a table.

A row may repeat its parameters, say for three obstacles: x, y become x1, y1, x2, y2, x3, y3. A rule over
`each` replica names the parameters plainly (`x > 1`); a rule over `pairs` names both partners (`a.x < b.x`);
a rule over the `row` names columns (`x1 < x2`).
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator
from dataclasses import replace
from functools import partial
from typing import Literal, TypeAlias

from parcours.data.constraints import substitute
from parcours.data.domains import Domain
from parcours.data.rule_names import path_of
from parcours.model.expression import Expression, Name

Scope: TypeAlias = Literal["row", "each", "pairs"]
"""What a rule speaks of."""

SCOPES: tuple[Scope, ...] = ("row", "each", "pairs")


def numbered(domain: Domain, replica: int) -> Domain:
    """Return the domain as one replica calls it; replicas count from 1."""
    return replace(domain, name=numbered_name(domain.name, replica))


def numbered_name(name: str, replica: int) -> str:
    """Return a name as one replica calls it; the number stands before the component of a vector.

    >>> numbered_name("v", 2), numbered_name("position.x", 2)
    ('v2', 'position2.x')
    """
    head, dot, tail = name.partition(".")
    return f"{head}{replica}{dot}{tail}"


def n_instances(scope: Scope, replicas: int) -> int:
    """Return how many constraints a rule becomes.

    >>> [n_instances(scope, 3) for scope in SCOPES]
    [1, 3, 3]
    """
    return {"row": 1, "each": replicas, "pairs": replicas * (replicas - 1) // 2}[scope]


def instances(
    name: str, scope: Scope, rule: Expression, parameters: Collection[str], replicas: int
) -> Iterator[tuple[str, Expression]]:
    """Yield each constraint that a rule stands for, with its name.

    >>> from parcours.model.expression import parse_expression
    >>> for made in instances("order", "pairs", parse_expression("a.x < b.x"), {"x"}, 3):
    ...     print(*made)
    order(1, 2) x1 < x2
    order(1, 3) x1 < x3
    order(2, 3) x2 < x3
    """
    everyone = range(1, replicas + 1)
    if scope == "row":
        yield name, rule
    elif scope == "each":
        for i in everyone:
            yield f"{name}({i})", substitute(rule, partial(_own, parameters, i))
    else:
        for i, j in itertools.combinations(everyone, 2):
            yield f"{name}({i}, {j})", substitute(rule, partial(_partners, parameters, i, j))


def _own(parameters: Collection[str], i: int, node: Expression) -> Expression | None:
    path = path_of(node)
    return Name(numbered_name(path, i)) if path is not None and path in parameters else None


def _partners(parameters: Collection[str], i: int, j: int, node: Expression) -> Expression | None:
    partner, _, name = (path_of(node) or "").partition(".")
    if partner not in ("a", "b") or name not in parameters:
        return None
    return Name(numbered_name(name, i if partner == "a" else j))
